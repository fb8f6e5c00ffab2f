"""Conformance: cases with a right answer, the results of any engine on them, and what passes."""
