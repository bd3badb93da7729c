"""The jail for code that a model or a stranger wrote: builder code, and inline skill scripts."""

from gap_cli.sandbox.builder import level, run_builder

__all__ = ["level", "run_builder"]
