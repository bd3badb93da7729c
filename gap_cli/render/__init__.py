"""A graph for people: Mermaid, a terminal tree, and a page with what happened in a run."""
