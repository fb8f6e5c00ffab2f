"""Rigid contact by impulses; parts fly in closed form and leap to the earliest possible contact."""
