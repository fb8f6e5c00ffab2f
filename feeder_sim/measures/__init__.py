"""Numbers from records, one object per measure."""
