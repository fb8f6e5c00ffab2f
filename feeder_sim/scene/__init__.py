"""Scenario -> scene: everything an engine needs, in SI units."""
