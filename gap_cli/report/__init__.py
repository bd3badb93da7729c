"""Pages about a run, for people."""
