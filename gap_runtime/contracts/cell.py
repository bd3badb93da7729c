"""A robot cell: cameras, arms, grippers, a clock and stop. What tools reach; a simulator is one (simulator.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

from gap_runtime.contracts.access import access
from gap_runtime.contracts.arm import Arm
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.types import WORLD, Observation, Se3Pose, Trajectory


@dataclass(frozen=True)
class CellFrame:
    """What a recorder sees at one instant of cell time: sensors, plus a simulator's ground truth for drawing only."""

    time: float
    observation: Observation
    snapshot: WorldSnapshot | None


class Cell(Protocol):
    """What a robot cell offers. Methods may be called from any thread; the cell serialises them."""

    @property
    @access("pure")
    def arms(self) -> Sequence[Arm]:
        """By arm_id."""

    @property
    @access("pure")
    def real_time(self) -> bool:
        """True where time passes by itself (a robot); false where it is stepped (a simulator)."""

    @property
    @access("pure")
    def time(self) -> float:
        """Cell time [s]: simulated time, or the cell's monotonic clock."""

    @property
    @access("pure")
    def camera_names(self) -> tuple[str, ...]:
        """All cameras, robot-mounted ones included, in a fixed order."""

    @access("sense")
    def observe(self, cameras: Sequence[str] | None = None) -> Observation:
        """RGB-D of the named cameras (default all) and the arms' states, all at one instant."""

    @access("sense")
    def camera_pose(self, name: str) -> Annotated[Se3Pose, WORLD]:
        """T_world_camera (optical) from calibration and forward kinematics. Raises `UnknownNameError`."""

    @access("actuate", "clock")
    def wait(self, seconds: float) -> None:
        """Let cell time pass."""

    @access("sense", privileged=True)
    def subscribe(
        self, listener: Callable[[CellFrame], None], hz: float, cameras: Sequence[str] = ()
    ) -> Callable[[], None]:
        """Call `listener` at `hz` of cell time while it passes; returns how to unsubscribe. Changes no physics."""

    @access("actuate", privileged=True)
    def close(self) -> None:
        """Free everything. Idempotent."""


@runtime_checkable
class LockstepCell(Protocol):
    """A cell whose arms can move together; whoever moves several at once asks for it."""

    @access("actuate", "arm:{motions}")
    def execute(self, motions: Mapping[int, Trajectory], *, tolerance: float = 0.01) -> None:
        """Track one trajectory per arm_id at the same time; done, refused and failing as `Arm.execute` is.

        When one arm fails, all of them stop.
        """
