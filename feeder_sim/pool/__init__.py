"""Many tasks at once: threads and processes of this machine, or any executor, and the loop that hands out to them."""
