"""Plates: natural modes, their shapes and nodal lines, how drives move them. Knows no scenario."""
