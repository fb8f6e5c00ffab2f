"""`python -m feeder_sim`."""

from feeder_sim.cli.main import main

main()
