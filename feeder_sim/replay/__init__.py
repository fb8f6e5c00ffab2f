"""Records -> .rrd for the rerun viewer; the only room that knows rerun."""
