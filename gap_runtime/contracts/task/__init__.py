"""A task, read from task.yaml: its cell, robots, cameras, objects, belief, reward and success."""

from gap_runtime.contracts.task.appearance import Appearance, rgb
from gap_runtime.contracts.task.belief import Belief, Distribution, Placement
from gap_runtime.contracts.task.cell import CameraPlacement, Environment, RobotPlacement, Support
from gap_runtime.contracts.task.document import Reward, SequenceStep, Task
from gap_runtime.contracts.task.load import load_task
from gap_runtime.contracts.task.objects import Joint, ObjectModel, Part
from gap_runtime.contracts.task.reading import Installed
from gap_runtime.contracts.task.robots import mounted_cameras
from gap_runtime.contracts.task.shape import Shape
from gap_runtime.contracts.task.success import fill, slots

__all__ = [
    "Appearance", "Belief", "CameraPlacement", "Distribution", "Environment", "Installed", "Joint", "ObjectModel",
    "Part", "Placement", "Reward", "RobotPlacement", "SequenceStep", "Shape", "Support", "Task", "fill", "load_task",
    "mounted_cameras", "rgb", "slots",
]  # fmt: skip
