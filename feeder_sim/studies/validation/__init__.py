"""Measurements and programs of others, computed anew: one module or two for each set."""
