"""The jail for code that a model or a stranger wrote: builder code, and inline skill scripts."""

from gap_cli.sandbox.builder import level, run_builder
from gap_cli.sandbox.scripts import ScriptJail

__all__ = ["ScriptJail", "level", "run_builder"]
