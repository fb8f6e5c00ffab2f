"""Reports: a run or a sweep as one HTML page that opens anywhere, offline."""
