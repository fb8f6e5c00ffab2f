"""Pairs of parts: which can meet, when, along which axis, at which points, and how they collide."""
