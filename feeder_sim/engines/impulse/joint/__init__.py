"""Many parts without a time step: each by the step of one part, and those that press each other together."""
