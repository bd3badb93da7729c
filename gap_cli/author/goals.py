"""What may be put where in a task, and why not."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, pi, prod

from gap_runtime.contracts.task import Shape, Task
from gap_runtime.contracts.task.goals import Goals
from gap_runtime.errors import InstructionError, did_you_mean


def refuse(
    task: Task,
    problem: str,
    *,
    word: str = "",
    known: Sequence[str] = (),
    kind: type[InstructionError] = InstructionError,
) -> InstructionError:
    """The error for an instruction that cannot be served: the problem, and what the task offers instead."""
    near = did_you_mean(word, known) if word else ""
    hint = [near] if near.startswith("Did you mean") else []
    containers = [m.label for m in task.objects.values() if m.is_container]
    hint.append(f"Objects: {', '.join(m.label for m in task.objects.values() if not m.is_container) or 'none'}.")
    hint.append(f"Containers: {', '.join(containers) or 'none'}.")
    hint.append(f'Say for example "{task.instructions[0]}".')
    return kind(problem, hint=" ".join(hint))


def check_goals(task: Task, goals: Goals) -> None:
    """Raise `InstructionError` where a goal makes no sense for the task's objects, or two contradict each other."""
    placed: dict[str, str] = {}
    for goal in goals.predicates():
        target, *rest = goal.roles.values()
        if not rest:
            continue
        label = task.objects[target].label
        if goal.predicate == "in":
            _check_pair(task, target, rest[0])
        elif target == rest[0]:
            raise refuse(task, f"The {label} cannot be put beside or onto itself.")
        if target in placed:
            again = "twice" if placed[target] == rest[0] else "in two places"
            raise refuse(task, f"The {label} cannot be placed {again}.")
        placed[target] = rest[0]
    for container in dict.fromkeys(placed.values()):
        if container in placed:
            raise refuse(task, f"The {task.objects[container].label} cannot be filled and moved in one instruction.")
        if container in task.objects:
            _check_room(task, container, [t for t, c in placed.items() if c == container])


def _check_pair(task: Task, inside: str, outside: str) -> None:
    if outside not in task.objects:
        raise refuse(task, f"Nothing can be put into the {outside.replace('_', ' ')}.")
    target, container = task.objects[inside], task.objects[outside]
    if inside == outside:
        raise refuse(task, f"The {target.label} cannot be put into itself.")
    if not container.is_container and container.shape.wall is not None:
        hint = f"List ids or categories in {task.name}'s task.yaml, below {outside}: accepts."
        raise InstructionError(f"The {container.label} is hollow, but the task does not say what it takes.", hint=hint)
    if not container.is_container:
        raise refuse(task, f"Nothing can be put into the {container.label}.")
    if not {inside, target.category, "*"} & set(container.accepts):
        raise refuse(task, f"The {container.label} takes {', '.join(container.accepts)}, not the {target.label}.")
    if not _passes(target.shape, container.shape):
        raise refuse(task, f"The {target.label} is too large for the {container.label}.")


def _check_room(task: Task, container: str, targets: Sequence[str]) -> None:
    if not _holds(task.objects[container].shape, [task.objects[t].shape.size for t in targets]):
        raise refuse(task, f"The {task.objects[container].label} cannot hold all {len(targets)} things.")


def _passes(thing: Shape, container: Shape) -> bool:
    """Whether it goes through the opening with its smallest side ahead; a shape without a cavity says nothing."""
    if container.wall is None:
        return True
    short, middle = sorted(thing.size)[:2]
    x, y, _ = container.size
    if container.kind == "open_box":
        narrow, wide = sorted((x - 2 * container.wall, y - 2 * container.wall))
        return short <= narrow and middle <= wide
    across = thing.size[1] if thing.kind == "cylinder" else hypot(short, middle)  # a cylinder can go in upright
    return across <= y - 2 * container.wall


def _holds(container: Shape, sizes: Sequence[tuple[float, float, float]]) -> bool:
    """Whether there is room for all: by volume, or, since things stick out of a pan or a mug, side by side on its
    floor. A shape without a cavity says nothing."""
    if container.wall is None or container.floor is None:
        return True
    x, y, z = container.size
    x, y, z = x - 2 * container.wall, y - 2 * container.wall, z - container.floor
    floor = x * y if container.kind == "open_box" else pi / 4 * y**2
    if sum(prod(size) for size in sizes) <= floor * z:
        return True
    return container.kind != "open_box" and sum(prod(sorted(size)[:2]) for size in sizes) <= floor
