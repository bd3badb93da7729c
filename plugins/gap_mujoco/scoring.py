"""Judges a task's success conditions on a snapshot, for a goal or for the one the scene is about."""

from __future__ import annotations

from gap_runtime.contracts.failures import BadRequestError, UnknownNameError
from gap_runtime.contracts.predicates import evaluate
from gap_runtime.contracts.snapshot import WorldSnapshot
from gap_runtime.contracts.task import Task


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
    slots = {"{target}": target or scene, "{container}": container or (containers[0] if len(containers) == 1 else "")}
    found = {}
    for name, expression in task.success.items():
        for slot, value in slots.items():
            if slot in expression and value not in models:
                raise BadRequestError("goal", f"Nothing says what {slot} is in scene {scene!r}.")
            expression = expression.replace(slot, value)
        found[name] = bool(evaluate(expression, snapshot))
    return found
