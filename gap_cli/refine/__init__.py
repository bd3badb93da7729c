"""Refinement: diagnose a rehearsal, propose changes, race them on the same instances, keep what is proven better."""
