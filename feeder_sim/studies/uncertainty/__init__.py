"""Uncertain inputs: what a result may be when they are, and which of them it hangs on."""
