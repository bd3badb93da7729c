"""Mesh tool (`sam3d.GenerateMesh`), embedded: space carving from calibrated depth, closed where no camera looked."""

from __future__ import annotations

from gap_catalogue.meshes import GeneratedMesh, GenerateMesh
from gap_runtime.contracts.tool import ToolContext, serves
from gap_runtime.contracts.types import Se3Pose, Vec3


@serves(GenerateMesh)
def generate_mesh(ctx: ToolContext, request: GenerateMesh) -> GeneratedMesh:
    """What a camera saw through is carved away; what none saw stays filled to the box.

    Method: space carving (Kutulakos and Seitz, 2000) against depth, and Taubin smoothing of the voxels' surface. The
    result depends on the views alone.
    """
    from gap_perception.models.mesh_views import read_views
    from gap_perception.models.obj_file import write_mesh
    from gap_perception.models.visual_hull import build_mesh

    obb, seen = request.obb, read_views(ctx, request.views)
    sizes = [int(view.mask.sum()) for view in seen]
    chosen = {"largest": sizes.index(max(sizes)), "first": 0, "last": len(seen) - 1}[request.view_selection]
    vertices, faces = build_mesh(seen, obb)
    mesh_path, texture_path = write_mesh(request.object_name, vertices, faces, obb, seen[chosen], request.output_dir)
    pose = Se3Pose(obb.center, obb.orientation)
    return GeneratedMesh(mesh_path, texture_path, pose, Vec3(1.0, 1.0, 1.0), chosen, len(vertices), len(faces))


TOOLS = (generate_mesh,)
