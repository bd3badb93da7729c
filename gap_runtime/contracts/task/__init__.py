"""A task, read from task.yaml: its cell, robots, cameras, objects, belief, reward and success."""

from gap_runtime.contracts.task.belief import Belief, Distribution, Placement
from gap_runtime.contracts.task.cell import CameraPlacement, Environment, RobotPlacement, Support
from gap_runtime.contracts.task.document import Reward, Task
from gap_runtime.contracts.task.load import load_task
from gap_runtime.contracts.task.objects import Joint, ObjectModel, Shape

__all__ = [
    "Belief", "CameraPlacement", "Distribution", "Environment", "Joint", "ObjectModel", "Placement", "Reward",
    "RobotPlacement", "Shape", "Support", "Task", "load_task",
]  # fmt: skip
