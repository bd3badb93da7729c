"""A simulator: a cell with instances to sample, a reset, and privileged ground truth for checkpoints and scoring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Protocol, cast

from gap_runtime.contracts.access import access
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.types import WORLD, Se3Pose


@dataclass(frozen=True)
class Instance:
    """One sample from the belief space: where every object starts. Poses are T_world_object."""

    seed: int
    scene: str
    poses: Mapping[str, Annotated[Se3Pose, WORLD]]
    joints: Mapping[str, float] = field(default_factory=dict)


class Simulator(Cell, Protocol):
    """A cell in physics. What it adds is out of reach of every node of a policy."""

    @access("sense", privileged=True)
    def sample(self, seed: int) -> Instance:
        """Draw an instance from the task's belief space. Raises `TaskInfeasibleError`."""

    @access("actuate", privileged=True)
    def reset(self, instance: Instance) -> None:
        """Start an episode: objects placed, settled, the arm at home. The only call that writes positions."""

    @access("sense", privileged=True)
    def snapshot(self) -> WorldSnapshot:
        """Ground truth. Privileged: raises `PrivilegedReadError` inside a policy node."""


def simulator_of(cell: Cell) -> Simulator:
    """The cell as the simulator that it is, for privileged tools. Raises `ToolError` code `no_simulator`."""
    if not hasattr(cell, "sample"):
        raise ToolError("no_simulator", "This cell is not a simulator.", hint="Run it with --cell of a simulator.")
    return cast(Simulator, cell)
