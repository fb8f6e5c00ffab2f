"""Loops that look where parts lie and choose the next mode: for more picks, and for a nut along a letter."""
