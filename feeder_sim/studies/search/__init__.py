"""Searches for the best recipe: Optuna proposes, seeds in parallel answer, losers stop early, the best is checked."""
