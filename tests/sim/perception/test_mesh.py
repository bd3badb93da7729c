from pathlib import Path

import numpy as np
import pytest

from gap_runtime.contracts.failures import BadRequestError, PerceptionError
from gap_runtime.contracts.types import Mask, OrientedBoundingBox, Quaternion, Vec3

pytestmark = pytest.mark.sim


@pytest.fixture
def views(cell, cameras):
    """The basket in both cameras."""
    return [
        {
            "rgb": c.rgb, "intrinsics": c.intrinsics, "camera_pose": c.pose,
            "mask": cell.tool("sam3.SegmentText", image=c.rgb, text_prompt="basket").masks[0],
        }
        for c in cameras
    ]  # fmt: skip


@pytest.fixture
def box(truth):
    return truth.bodies["basket"].box


def read(path):
    rows = [line.split() for line in Path(path).read_text().splitlines()]
    vertices = np.array([r[1:] for r in rows if r[0] == "v"], dtype=float)
    faces = np.array([[int(v.split("/")[0]) - 1 for v in r[1:]] for r in rows if r[0] == "f"])
    return vertices, faces


def test_the_basket_becomes_a_closed_hollow_mesh_on_disk(cell, views, box, tmp_path):
    mesh = cell.tool("sam3d.GenerateMesh", object_name="basket", views=views, obb=box, output_dir=str(tmp_path / "m"))
    vertices, faces = read(mesh.mesh_path)
    assert (len(vertices), len(faces)) == (mesh.num_vertices, mesh.num_faces) and Path(mesh.texture_path).is_file()
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    volume = np.einsum("ni,ni->", a, np.cross(b, c)) / 6
    assert 0.1 < volume / (8 * box.extent.array.prod()) < 0.8
    assert np.all(np.abs(vertices) <= box.extent.array + 0.006)


def test_the_same_views_give_the_same_bytes(cell, views, box, tmp_path):
    paths = [
        cell.tool(
            "sam3d.GenerateMesh", object_name="basket", views=views, obb=box, output_dir=str(tmp_path / d)
        ).mesh_path
        for d in "ab"
    ]
    assert Path(paths[0]).read_bytes() == Path(paths[1]).read_bytes()


def test_views_and_folders_that_are_none_are_refused(cell, views, box, tmp_path):
    make = lambda **inputs: cell.tool("sam3d.GenerateMesh", **{"object_name": "x", "views": views, "obb": box} | inputs)  # noqa: E731
    small = views[0] | {"mask": Mask(np.ones((3, 3), bool))}
    (tmp_path / "file").write_text("")
    for bad in ([], [{}], [1], [views[0] | {"color": 1}], [small], [views[0] | {"camera_pose": "here"}]):
        with pytest.raises(BadRequestError, match="view"):
            make(views=bad)
    with pytest.raises(BadRequestError, match="file"):
        make(output_dir=str(tmp_path / "file"))
    with pytest.raises(BadRequestError, match="view_selection"):
        make(view_selection="best")
    with pytest.raises(PerceptionError, match="nothing"):
        make(obb=OrientedBoundingBox(Vec3(0, 0, 3), Vec3(0.1, 0.1, 0.1), Quaternion(1, 0, 0, 0)))
