"""Speed against accuracy of every method, what simplifications save, and where methods fail."""
