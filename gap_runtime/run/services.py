"""What every node of one run shares: the cell, the task, the tools, the jail, leases and memory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.task.rendering import ObjectRenderer
from gap_runtime.graph.compiled import BoundCallable
from gap_runtime.run.leases import Leases


class ScriptRunner(Protocol):
    """Runs untrusted code in a jail."""

    def __call__(
        self,
        source_path: Path,
        inputs: dict[str, Any],
        call_tool: Callable[[str, dict[str, Any]], Any],
        deadline_s: float,
        *,
        publish: Callable[[Any], None] | None = None,
        check: Callable[[], None] | None = None,
        robot: Callable[[int], RobotSpec] | None = None,
        seed: int = 0,
    ) -> Any:
        """What the script's `run` returned. `call_tool`, `publish` and `robot` are served here; `check` raises to give
        up."""


class SharedStore:
    """Things derived from models alone, made once per process. Two nodes that ask at once get one object."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._made: dict[str, Any] = {}

    def get(self, key: str, make: Callable[[], Any]) -> Any:
        """The object made for `key`, made now if it is the first request."""
        with self._lock:
            if key not in self._made:
                self._made[key] = make()
            return self._made[key]


SHARED = SharedStore()


@dataclass
class Services:
    """What every node of one run shares. `completing` guards who decides how an attempt ended."""

    callees: Mapping[str, BoundCallable]
    cell: Cell | None
    task: Task | None
    robots: tuple[RobotSpec, ...]
    seed: int
    script_runner: ScriptRunner | None
    shared: SharedStore
    renderer: ObjectRenderer | None
    patience: float
    record_calls: bool
    lockstep: bool = False
    state: dict[str, Any] = field(default_factory=dict)
    leases: Leases = field(default_factory=Leases)
    completing: threading.Lock = field(default_factory=threading.Lock)
