"""Meshes of objects from masked views: `sam3d.*`."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolRequest
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3

SELECTIONS = ("largest", "first", "last")


class GeneratedMesh(NamedTuple):
    """An .obj file in the box's frame [m] (`scale` is 1), its texture, where it stands, and how large it is."""

    mesh_path: str
    texture_path: str
    world_pose: Annotated[Se3Pose, WORLD]
    scale: Vec3
    chosen_view_index: int
    num_vertices: int
    num_faces: int


class GenerateMesh(ToolRequest[GeneratedMesh], tool="sam3d.GenerateMesh", effect="sense", deadline_s=30.0):
    """Make a closed mesh of an object in its box, from masked views, and write it as .obj with a texture.

    A view is a mapping with `rgb`, `mask`, `intrinsics`, `camera_pose` (T_world_camera) and, where the image was not
    observed in this episode, `depth`. `view_selection` says which view gives the texture: the one with the largest
    mask, the first or the last. `seed` is for learned providers. `output_dir` defaults to a temporary folder.
    Raises `BadRequestError` for views that are none, or a folder that cannot be written; `PerceptionError`
    (`nothing_seen`) when the views see nothing inside the box.
    """

    object_name: str
    views: list[Any]
    obb: Annotated[OrientedBoundingBox, WORLD]
    view_selection: str = "largest"
    seed: int = 42
    output_dir: str = ""

    def __post_init__(self) -> None:
        if self.view_selection not in SELECTIONS:
            raise BadRequestError(
                "view_selection", f"view_selection {self.view_selection!r} is not one of {', '.join(SELECTIONS)}."
            )
