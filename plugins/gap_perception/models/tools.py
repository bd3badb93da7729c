"""Mesh tool (`sam3d.GenerateMesh`), embedded: space carving from calibrated depth, closed where no camera looked."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from gap_perception.frames import DEADLINE_S
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, tool
from gap_runtime.contracts.types import WORLD, OrientedBoundingBox, Se3Pose, Vec3

SELECTIONS = ("largest", "first", "last")


class Mesh(NamedTuple):
    """An .obj file in the box's frame [m] (`scale` is 1), its texture, where it stands, and how large it is."""

    mesh_path: str
    texture_path: str
    world_pose: Annotated[Se3Pose, WORLD]
    scale: Vec3
    chosen_view_index: int
    num_vertices: int
    num_faces: int


@tool("sam3d.GenerateMesh", effect="sense", deadline_s=DEADLINE_S)
def generate_mesh(
    ctx: ToolContext,
    object_name: str,
    views: list[Any],
    obb: Annotated[OrientedBoundingBox, WORLD],
    view_selection: str = "largest",
    seed: int = 42,
    output_dir: str = "",
) -> Mesh:
    """Carve a closed mesh of an object out of its box, from masked views, and write it as .obj with a texture.

    A view is a mapping with `rgb`, `mask`, `intrinsics`, `camera_pose` (T_world_camera) and, where the image was not
    observed in this episode, `depth`. What a camera saw through is carved away; what none saw stays filled to the box.
    `view_selection` says which view gives the texture: the one with the largest mask, the first or the last. The
    result depends on the views alone; `seed` is for learned providers. `output_dir` defaults to a temporary folder.
    Method: space carving (Kutulakos and Seitz, 2000) against depth, and Taubin smoothing of the voxels' surface.
    Raises `BadRequestError` for views that are none, or a folder that cannot be written; `PerceptionError`
    (`nothing_seen`) when the views see nothing inside the box.
    """
    from gap_perception.models.mesh_views import read_views
    from gap_perception.models.obj_file import write_mesh
    from gap_perception.models.visual_hull import build_mesh

    if view_selection not in SELECTIONS:
        raise BadRequestError(
            "view_selection", f"view_selection {view_selection!r} is not one of {', '.join(SELECTIONS)}."
        )
    seen = read_views(ctx, views)
    sizes = [int(view.mask.sum()) for view in seen]
    chosen = {"largest": sizes.index(max(sizes)), "first": 0, "last": len(seen) - 1}[view_selection]
    vertices, faces = build_mesh(seen, obb)
    mesh_path, texture_path = write_mesh(object_name, vertices, faces, obb, seen[chosen], output_dir)
    pose = Se3Pose(obb.center, obb.orientation)
    return Mesh(mesh_path, texture_path, pose, Vec3(1.0, 1.0, 1.0), chosen, len(vertices), len(faces))


TOOLS = (generate_mesh,)
