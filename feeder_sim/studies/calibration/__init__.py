"""What measurements say about constants that nobody knows exactly, and what they cannot say."""
