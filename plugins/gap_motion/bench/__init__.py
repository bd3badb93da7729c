"""`gap bench motion`: planning problems, measurements and an independent verifier."""
