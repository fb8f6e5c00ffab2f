"""Pictures of comparisons with measurements and programs of others."""
