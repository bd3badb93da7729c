"""Who writes graphs: the symbolic author, from a sentence to a plan, and from a plan to a validated workflow."""
