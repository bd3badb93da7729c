"""Judges an episode by the task's success conditions, once everything the goals name was let go and came to rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gap_runtime.contracts.cell import CellFrame
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.simulator import Simulator
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.task import SequenceStep, Task, fill, slots
from gap_runtime.graph.checkpoints import evaluate

SETTLE_LIMIT_S = 3.0  # of world time: what rolls longer than this after release has not been placed
SETTLE_STEP_S = 0.1
SEQUENCE_HZ = 20.0  # how often a task's sequence is looked at
STILL_STEPS = 2  # a swinging body stands still for an instant; two looks in a row are rest


@dataclass(frozen=True)
class Conditions:
    """`expressions` by name, their slots filled; `objects` are the ids that must be let go and at rest."""

    expressions: Mapping[str, str]
    objects: tuple[str, ...]


class SequenceMonitor:
    """Watches a task's `sequence` while an episode runs: how far it got, in order. Privileged; changes nothing."""

    def __init__(self, simulator: Simulator, steps: Sequence[SequenceStep]) -> None:
        self._steps, self._reached = steps, 0
        self._since: float | None = None
        self.stop = simulator.subscribe(self._look, SEQUENCE_HZ) if steps else lambda: None

    @property
    def conditions(self) -> dict[str, bool]:
        """By step, whether it was reached."""
        return {f"sequence.{step.name}": i < self._reached for i, step in enumerate(self._steps)}

    def _look(self, frame: CellFrame) -> None:
        if self._reached == len(self._steps) or frame.snapshot is None:
            return
        step = self._steps[self._reached]
        if not evaluate(step.when, frame.snapshot):
            self._since = None
            return
        self._since = frame.time if self._since is None else self._since
        if frame.time - self._since >= step.hold:
            self._reached, self._since = self._reached + 1, None


@dataclass(frozen=True)
class Verdict:
    """The value of each condition, and whether the objects were let go and at rest when it was read."""

    conditions: Mapping[str, bool]
    at_rest: bool

    @property
    def success(self) -> bool:
        """Everything holds, at rest; nothing asked is nothing achieved."""
        return self.at_rest and bool(self.conditions) and all(self.conditions.values())


def make_conditions(task: Task, goals: Sequence[Mapping[str, str]]) -> Conditions:
    """Fill the task's success expressions from each goal (role -> object id). Raises `DocumentError`.

    With several goals each condition appears once per goal, named `<name>.<target>`.
    """
    filled: dict[str, str] = {}
    for goal in goals:
        suffix = "." + goal.get("target", str(len(filled))) if len(goals) > 1 else ""
        for name, expression in task.success.items():
            filled[name + suffix] = _fill(task, name, expression, goal)
    objects = dict.fromkeys(name for goal in goals for name in goal.values())
    return Conditions(filled, tuple(objects))


def settle(simulator: Simulator, objects: Sequence[str]) -> bool:
    """Let world time pass until the objects are let go and at rest; False when `SETTLE_LIMIT_S` was not enough."""
    still = 0
    for _ in range(round(SETTLE_LIMIT_S / SETTLE_STEP_S)):
        still = still + 1 if _resting(simulator.snapshot(), objects) else 0
        if still >= STILL_STEPS:
            return True
        simulator.wait(SETTLE_STEP_S)
    return _resting(simulator.snapshot(), objects)


def judge(simulator: Simulator, conditions: Conditions, sequence: SequenceMonitor | None = None) -> Verdict:
    """Wait for rest, then read every condition off the ground truth, those of the task's sequence included."""
    at_rest = settle(simulator, conditions.objects)
    snapshot = simulator.snapshot()
    values = {name: bool(evaluate(text, snapshot)) for name, text in conditions.expressions.items()}
    return Verdict({**values, **(sequence.conditions if sequence else {})}, at_rest)


def _resting(snapshot: WorldSnapshot, objects: Sequence[str]) -> bool:
    bodies = [snapshot.body(name) for name in objects]
    return all(body.is_settled() and body.is_released() for body in bodies)


def _fill(task: Task, name: str, expression: str, goal: Mapping[str, str]) -> str:
    unsaid = [slot for slot in slots(expression) if slot not in goal]
    if unsaid:
        problem = f"success.{name}: no goal says what {{{unsaid[0]}}} is"
        raise DocumentError(str(task.path / "task.yaml"), problem, hint=f"Slots: {', '.join(goal)}.")
    return fill(expression, goal)
