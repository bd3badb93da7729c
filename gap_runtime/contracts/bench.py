"""What a benchmark gives: one table, with what is needed to believe it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Progress = Callable[[float, str], None]
"""(how much is done, 0 to 1; what is being measured now)."""


@dataclass(frozen=True)
class Table:
    """A further table of a report."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture beside a report: what it shows, and an encoded image with its `suffix` (".jpg", ".png")."""

    caption: str
    suffix: str
    data: bytes


@dataclass(frozen=True)
class BenchReport:
    """A benchmark's result: a table, and any more of them. `notes` say how it was measured; `packages` are
    distributions whose version matters; `pictures` show what no number does."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    notes: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()
    more: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


Benchmark = Callable[[Progress], BenchReport]
