"""Judges a task's success conditions on a snapshot, for a goal or for the one the scene is about."""

from __future__ import annotations

from gap_runtime.contracts.failures import BadRequestError, UnknownNameError
from gap_runtime.contracts.predicates import evaluate
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.task import Task, fill, slots


def conditions(
    task: Task, scene: str, snapshot: WorldSnapshot, target: str = "", container: str = ""
) -> dict[str, bool]:
    """Each success condition of the task, by name. Unnamed, the target is the scene's namesake, the container its only
    one. Raises `UnknownNameError`, `BadRequestError`."""
    models = task.scene_objects(scene)
    for name in filter(None, (target, container)):
        if name not in models:
            raise UnknownNameError(f"object in scene {scene!r}", name, models)
    containers = [name for name, model in models.items() if model.is_container]
    values = {"target": target or scene, "container": container or (containers[0] if len(containers) == 1 else "")}
    found = {}
    for name, expression in task.success.items():
        unsaid = [slot for slot in slots(expression) if values.get(slot) not in models]
        if unsaid:
            raise BadRequestError("goal", f"Nothing says what {{{unsaid[0]}}} is in scene {scene!r}.")
        found[name] = bool(evaluate(fill(expression, values), snapshot))
    return found
