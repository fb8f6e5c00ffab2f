"""The impulse engine for parts that act back on the plate."""
