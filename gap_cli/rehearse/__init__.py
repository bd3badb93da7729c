"""Rehearsal: sample instances, roll the graph out in physics, judge each, and say what to revise."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gap_cli.rehearse.rehearsal import Summary, rehearse

__all__ = ["Summary", "rehearse"]


def __getattr__(name: str) -> Any:
    """Load the rehearsal when it is asked for: a worker imports its own part of this package and nothing else."""
    if name in __all__:
        from gap_cli.rehearse import rehearsal

        return getattr(rehearsal, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
