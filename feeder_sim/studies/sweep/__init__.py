"""Sweeps: a scenario at many points, with common random numbers, as many seeds as the answer takes, and a table."""
