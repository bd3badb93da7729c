"""The interpreter: graph run, super-steps, node attempts, leases, streams, deadlines, events."""
