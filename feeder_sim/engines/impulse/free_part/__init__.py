"""One part on the plate, without a time step (docs/contact.md)."""
