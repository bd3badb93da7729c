"""`gap bench perception`: random cluttered scenes against ground truth."""
