"""Modes of any plate from shapes at points, as measurements and other programs give them."""
