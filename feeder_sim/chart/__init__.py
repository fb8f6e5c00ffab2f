"""Speed against accuracy: cases with a known answer, ways of computing them, and where those ways fail."""
