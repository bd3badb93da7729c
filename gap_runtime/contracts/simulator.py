"""A simulator: a cell on a stepped clock, with instances to sample, a reset, and privileged ground truth."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Annotated, Any, Protocol, TypeVar, cast, runtime_checkable

from gap_runtime.contracts.access import access
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.types import WORLD, Se3Pose

T = TypeVar("T")
Process = Generator[None, None, T]
"""A command that takes time: it yields once for every step of cell time that it waits for, and returns its result."""
_waiter: ContextVar[Callable[[TimedCommand], None] | None] = ContextVar("waiter", default=None)


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


class TimedCommand:
    """A process under way: it is resumed after every step, on the cell's own thread, until it is `over`."""

    def __init__(self, process: Process[Any]) -> None:
        self._process = process
        self.over = False
        self._value: Any = None
        self._error: BaseException | None = None

    def resume(self) -> None:
        """Let it see what the last step did."""
        try:
            next(self._process)
        except StopIteration as end:
            self.over, self._value = True, end.value
        except BaseException as error:
            self.fail(error)

    def fail(self, error: BaseException) -> None:
        """It is over, because of this error."""
        self.over, self._error = True, error

    def result(self) -> Any:
        """What the process returned. Raises what it raised."""
        if self._error is not None:
            raise self._error
        return self._value


class SteppedClock:
    """The time of a stepped cell: it passes while commands wait for it.

    `call` runs a function on the cell's own thread, `step` lets one step of time pass. A command that waits alone has
    it stepped at once; in a thread within `waiting_by` it waits for whoever coordinates several of them by `advance`.
    """

    def __init__(self, call: Callable[[Callable[[], None]], None], step: Callable[[], None]) -> None:
        self._call, self._step = call, step

    def run(self, process: Process[T]) -> T:
        """Let time pass until the process is over; its result. Raises what it, or a step, raises."""
        command, waiter = TimedCommand(process), _waiter.get()
        if waiter is None:
            self._call(lambda: self._run_alone(command))
        else:
            self._call(command.resume)
            if not command.over:
                waiter(command)
        return cast(T, command.result())

    def advance(self, commands: Sequence[TimedCommand], interrupted: Callable[[], bool]) -> None:
        """Let time pass until at least one of these commands, all of them waiting, is over, or until `interrupted`."""
        self._call(lambda: self._step_all(commands, interrupted))

    def _run_alone(self, command: TimedCommand) -> None:
        command.resume()
        if not command.over:
            self._step_all([command], lambda: False)

    def _step_all(self, commands: Sequence[TimedCommand], interrupted: Callable[[], bool]) -> None:
        try:
            while not (any(command.over for command in commands) or interrupted()):
                self._step()
                for command in commands:
                    command.resume()
        except BaseException as error:
            for command in commands:
                command.fail(error)


@contextmanager
def waiting_by(waiter: Callable[[TimedCommand], None]) -> Iterator[None]:
    """Commands of this thread wait by `waiter(command)`, which returns once the command is over, or raises."""
    token = _waiter.set(waiter)
    try:
        yield
    finally:
        _waiter.reset(token)


@runtime_checkable
class SteppedCell(Protocol):
    """A cell whose commands all wait by one `SteppedClock`, so that several nodes can command it at the same time."""

    @property
    @access("pure", privileged=True)
    def clock(self) -> SteppedClock:
        """Its time."""
