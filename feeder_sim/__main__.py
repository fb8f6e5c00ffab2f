"""`python -m feeder_sim`."""

from feeder_sim.cli import main

main()
