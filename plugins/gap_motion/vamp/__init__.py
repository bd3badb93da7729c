"""Provider `vamp`: paths found by VAMP where it is installed."""
