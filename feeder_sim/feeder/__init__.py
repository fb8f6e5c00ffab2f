"""A feeder that is told what to do while it runs: vibrate, look, pick, refill; and the same as an environment."""
