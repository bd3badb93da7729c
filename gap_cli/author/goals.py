"""Goals over a task's objects: what may be put where, and why not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from gap_cli.contracts.failures import did_you_mean
from gap_cli.contracts.task import Shape, Task
from gap_cli.errors import InstructionError


@dataclass(frozen=True)
class Goal:
    """`target` shall end up in `container`; both are object ids."""

    target: str
    container: str

    @property
    def fact(self) -> str:
        """The goal as skill contracts write it."""
        return f"in({self.target}, {self.container})"


def refuse(task: Task, problem: str, *, word: str = "", known: Sequence[str] = ()) -> InstructionError:
    """The error for an instruction that cannot be served: the problem, and what the task offers instead."""
    near = did_you_mean(word, known) if word else ""
    hint = [near] if near.startswith("Did you mean") else []
    containers = [m.label for m in task.objects.values() if m.is_container]
    hint.append(f"Objects: {', '.join(m.label for m in task.objects.values() if not m.is_container) or 'none'}.")
    hint.append(f"Containers: {', '.join(containers) or 'none'}.")
    hint.append(f'Say for example "{task.instructions[0]}".')
    return InstructionError(problem, hint=" ".join(hint))


def check_goals(task: Task, goals: Sequence[Goal]) -> None:
    """Raise `InstructionError` where a goal makes no sense for the task's objects, or two contradict each other."""
    placed: dict[str, str] = {}
    for goal in goals:
        _check_pair(task, goal)
        target = task.objects[goal.target].label
        if goal.target in placed:
            again = "twice" if placed[goal.target] == goal.container else "in two places"
            raise refuse(task, f"The {target} cannot be placed {again}.")
        placed[goal.target] = goal.container
    for goal in goals:
        if goal.container in placed:
            label = task.objects[goal.container].label
            raise refuse(task, f"The {label} cannot be filled and moved in one instruction.")
    for container in dict.fromkeys(placed.values()):
        _check_volume(task, container, [t for t, c in placed.items() if c == container])


def _check_pair(task: Task, goal: Goal) -> None:
    target, container = task.objects[goal.target], task.objects[goal.container]
    if goal.target == goal.container:
        raise refuse(task, f"The {target.label} cannot be put into itself.")
    if not container.is_container:
        raise refuse(task, f"Nothing can be put into the {container.label}.")
    if not {goal.target, target.category, "*"} & set(container.accepts):
        raise refuse(task, f"The {container.label} takes {', '.join(container.accepts)}, not the {target.label}.")
    inner = _inner(container.shape)
    if inner is not None:
        opening, waist = sorted(inner[:2]), sorted(target.shape.size)[:2]
        if any(w > o for w, o in zip(waist, opening, strict=True)):
            raise refuse(task, f"The {target.label} is too large for the {container.label}.")


def _check_volume(task: Task, container: str, targets: Iterable[str]) -> None:
    inner = _inner(task.objects[container].shape)
    if inner is None:
        return
    sizes = [task.objects[t].shape.size for t in targets]
    if sum(x * y * z for x, y, z in sizes) > inner[0] * inner[1] * inner[2]:
        raise refuse(task, f"The {task.objects[container].label} cannot hold all {len(sizes)} things.")


def _inner(shape: Shape) -> tuple[float, float, float] | None:
    """Free space inside an open box [m]; None for other shapes, whose capacity is not known."""
    if shape.kind != "open_box" or shape.wall is None or shape.floor is None:
        return None
    x, y, z = shape.size
    return x - 2 * shape.wall, y - 2 * shape.wall, z - shape.floor
