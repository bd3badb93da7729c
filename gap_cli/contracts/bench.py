"""What a benchmark gives: one table, with what is needed to believe it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Progress = Callable[[float, str], None]
"""(how much is done, 0 to 1; what is being measured now)."""


@dataclass(frozen=True)
class BenchReport:
    """A benchmark's result. `notes` say how it was measured; `packages` are distributions whose version matters."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    notes: tuple[str, ...] = ()
    packages: tuple[str, ...] = ()


Benchmark = Callable[[Progress], BenchReport]
