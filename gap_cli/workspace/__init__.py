"""The run directory: canonical files, the lock, and which stage a run has reached."""
