"""A part on a slide: one degree of freedom, every event found exactly."""
