"""One seed, the ensemble, its guard, and the run folder."""
