"""What a user of Python holds in hands: calls and results, with tables and plots. `feeder_sim` has their names."""
