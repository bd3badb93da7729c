"""A task, read from task.yaml: its cell, robots, cameras, objects, belief, reward and success."""

from gap_runtime.contracts.task.belief import Belief, Distribution, Placement
from gap_runtime.contracts.task.cell import CameraPlacement, Environment, RobotPlacement, Support
from gap_runtime.contracts.task.document import Reward, SequenceStep, Task
from gap_runtime.contracts.task.load import load_task
from gap_runtime.contracts.task.objects import Joint, ObjectModel, Part, Shape

__all__ = [
    "Belief", "CameraPlacement", "Distribution", "Environment", "Joint", "ObjectModel", "Part", "Placement", "Reward",
    "RobotPlacement", "SequenceStep", "Shape", "Support", "Task", "load_task",
]  # fmt: skip
