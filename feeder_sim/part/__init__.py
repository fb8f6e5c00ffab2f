"""Rigid parts: their shape, mass, contact corners and stable poses; knows no scenario."""
