"""The values that flow along edges, by name."""

from gap_runtime.contracts.types.geometry import (
    BASE,
    CAMERA,
    TCP,
    WORLD,
    BoundingBox2D,
    Frame,
    OrientedBoundingBox,
    Quaternion,
    Se3Pose,
    Vec3,
)
from gap_runtime.contracts.types.messages import (
    CONTRACT_TYPES,
    SCALAR_TYPES,
    ActionChunk,
    ArmState,
    CameraObservation,
    DepthImage,
    Detection,
    Grasp,
    GripperState,
    Image,
    JointState,
    Mask,
    Matrix3x3,
    ObjectMask,
    ObjectPose,
    Observation,
    Obstacle,
    PointCloud,
    Trajectory,
    WorldConfig,
    Wrench,
)
from gap_runtime.contracts.types.value import Array, Value

__all__ = [
    "BASE", "CAMERA", "CONTRACT_TYPES", "SCALAR_TYPES", "TCP", "WORLD", "ActionChunk", "ArmState", "Array",
    "BoundingBox2D", "CameraObservation", "DepthImage", "Detection", "Frame", "Grasp", "GripperState", "Image",
    "JointState", "Mask", "Matrix3x3", "ObjectMask", "ObjectPose", "Observation", "Obstacle", "OrientedBoundingBox",
    "PointCloud", "Quaternion", "Se3Pose", "Trajectory", "Value", "Vec3", "WorldConfig", "Wrench",
]  # fmt: skip
