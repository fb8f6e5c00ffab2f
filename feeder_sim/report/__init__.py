"""Reports: a run, or a question asked of many runs, as one HTML page that opens anywhere, offline."""
