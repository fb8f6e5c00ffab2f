"""The page on which feeders are designed: a view of a scenario file, in a browser, from this machine alone."""
