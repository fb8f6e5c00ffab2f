"""The Ritz method for rectangular plates: trial functions, matrices, and what is fixed to the plate."""
