"""Modes of a plate of any outline by finite elements: its mesh, the energies of its sections, what supports it."""
