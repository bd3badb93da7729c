"""The rules a graph must keep: S structure, W workflow, D data, R resources, P privilege, K skill contract."""
