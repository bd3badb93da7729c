"""Workflow v3 as data: model, references, loading, control flow and compilation."""
