"""Drawings of plates: the strokes of a DXF or an SVG file, and the rings that they make."""
