"""Objects whose shape is a file: a mesh that collides as convex parts, or an MJCF or URDF model with joints."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from dm_control import mjcf

from gap_mujoco.model.primitives import VISUAL_ONLY, contact_attributes
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.task import Appearance, ObjectModel, Shape, rgb
from gap_runtime.contracts.task.mesh_file import load_mesh, load_solid
from gap_runtime.contracts.types import Array

CONCAVITY = 0.03  # CoACD's threshold: the depth of a dent that is still kept, as a share of the mesh's size
CONVEX = 0.99  # a mesh that fills this share of its hull is its hull
TEXTURE = 512  # px: the longest side of a texture; more slows software rendering and shows nothing
SIZE_TOLERANCE = 0.005  # [m] between the size a task gives for an articulated object and its model's


def build_mesh(root: mjcf.RootElement, model: ObjectModel, looks: Appearance) -> None:
    """Add a mesh's convex parts, with its mass, and what is seen of it."""
    shape = model.shape
    parts = convex_parts(shape)
    volumes = [_volume(vertices, faces) for vertices, faces in parts]
    for i, (vertices, faces) in enumerate(parts):
        asset = root.asset.add("mesh", name=f"part{i}", vertex=vertices.ravel(), face=faces.ravel())
        root.worldbody.add(
            "geom", type="mesh", mesh=asset, mass=model.mass * volumes[i] / sum(volumes), **contact_attributes(model)
        )
    mesh = _mesh_of(shape)
    texcoord, image, colour = _surface(mesh, model, looks)
    asset = root.asset.add(
        "mesh", name="surface", inertia="shell", vertex=mesh.vertices.ravel(), face=mesh.faces.ravel(),
        texcoord=None if texcoord is None else texcoord.ravel(),
    )  # fmt: skip
    look: dict[str, Any] = {"rgba": colour}
    if image is not None:
        _, png = cv2.imencode(".png", image[:, :, ::-1])
        texture = root.asset.add("texture", name="surface", type="2d", file=mjcf.Asset(png.tobytes(), ".png"))
        look = {"material": root.asset.add("material", name="surface", texture=texture, specular=0.15, shininess=0.2)}
    root.worldbody.add("geom", type="mesh", mesh=asset, **look, **VISUAL_ONLY)


def build_articulated(name: str, model: ObjectModel) -> mjcf.RootElement:
    """The MJCF of an articulated object, physics options left to the scene. Raises `DocumentError`."""
    file = model.shape.file
    assert file is not None  # the task was checked when it was read
    try:
        if file.suffix == ".urdf":
            # MuJoCo reads URDF, dm_control does not; meshes are found beside the file.
            xml = mujoco.MjSpec.from_file(str(file)).to_xml()
            root = mjcf.from_xml_string(xml, model_dir=str(file.parent))
        else:
            root = mjcf.from_path(str(file))
    except Exception as error:  # two parsers, each with errors of its own
        raise DocumentError(f"objects.{name}.shape.file", f"{file.name} cannot be read: {error}") from None
    root.model = name
    for section in (root.option, root.option.flag, root.statistic, root.visual, root.size):
        for attribute in section.get_attributes():
            delattr(section, attribute)
    _check_size(name, model, root)
    return root


def convex_parts(shape: Shape) -> list[tuple[Array, Array]]:
    """Vertices (N, 3) [m] and triangles (M, 3) of the convex parts a mesh collides as, kept on disk by content."""
    assert shape.file is not None
    mesh = load_solid(shape.file, shape.scale, shape.rotate)
    hull = mesh.convex_hull
    if shape.parts == 1 or (mesh.is_watertight and abs(mesh.volume) > CONVEX * hull.volume):
        return [(np.asarray(hull.vertices), np.asarray(hull.faces))]
    kept = _cache_file(shape, mesh)
    if kept is not None and kept.is_file():
        with np.load(kept) as found:
            return [(found[f"v{i}"], found[f"f{i}"]) for i in range(len(found.files) // 2)]
    import coacd

    coacd.set_log_level("error")
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces), threshold=CONCAVITY, max_convex_hull=shape.parts, seed=0
    )
    if kept is not None:
        _keep(kept, parts)
    return [(np.asarray(vertices), np.asarray(faces)) for vertices, faces in parts]


def silhouette(shape: Shape) -> Array:
    """Corners (N, 2) [m] of the convex hull of a mesh seen from above, in the object's frame."""
    from scipy.spatial import ConvexHull

    points = np.asarray(_mesh_of(shape).vertices)[:, :2]
    return np.asarray(points[ConvexHull(points).vertices])


def _mesh_of(shape: Shape) -> Any:
    assert shape.file is not None
    return load_mesh(shape.file, shape.scale, shape.rotate)


def _volume(vertices: Array, faces: Array) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return max(float(abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6), 1e-12)


def _surface(mesh: Any, model: ObjectModel, looks: Appearance) -> tuple[Array | None, Array | None, tuple[float, ...]]:
    """Texture coordinates, picture and colour; the task's looks come before the file's own."""
    material = getattr(mesh.visual, "material", None)
    uv = getattr(mesh.visual, "uv", None)
    image = None
    if looks.texture:
        assert model.shape.file is not None
        image = cv2.imread(str(model.shape.file.parent / looks.texture))
        image = None if image is None else image[:, :, ::-1]
    elif "base" not in looks.model_fields_set and material is not None:
        found = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
        image = None if found is None else np.asarray(found.convert("RGB"))
    if uv is not None and image is not None:
        longest = max(image.shape[:2])
        if longest > TEXTURE:
            image = cv2.resize(image, None, fx=TEXTURE / longest, fy=TEXTURE / longest, interpolation=cv2.INTER_AREA)
        return np.column_stack([uv[:, 0], 1 - uv[:, 1]]), image, (1.0, 1.0, 1.0, 1.0)
    if "base" in looks.model_fields_set or not mesh.visual.defined:
        colour = np.array(rgb(looks.base)) / 255
    else:
        colour = np.asarray(mesh.visual.to_color().face_colors)[:, :3].mean(axis=0) / 255
    return None, None, (*(float(c) for c in colour), 1.0)


def _check_size(name: str, model: ObjectModel, root: mjcf.RootElement) -> None:
    """Raise `DocumentError` where the box of the model's geoms is not the size the task gives, about its origin."""
    compiled = mujoco.MjModel.from_xml_string(root.to_xml_string(), root.get_assets())
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    boxes = [
        data.geom_xpos[g] + (compiled.geom_aabb[g, :3] + corners * compiled.geom_aabb[g, 3:])
        @ data.geom_xmat[g].reshape(3, 3).T
        for g in range(compiled.ngeom)
    ]  # fmt: skip
    low, high = np.concatenate(boxes).min(axis=0), np.concatenate(boxes).max(axis=0)
    half = np.array(model.shape.size) / 2
    if np.abs(np.concatenate([low + half, high - half])).max() > SIZE_TOLERANCE:
        size, centre = ([round(float(v), 4) for v in values] for values in (high - low, (high + low) / 2))
        raise DocumentError(
            f"objects.{name}.shape", f"size {list(model.shape.size)} about the origin is not that of the model in "
            f"{model.shape.file and model.shape.file.name}: {size} about {centre}",
            hint="Give that size, and put the model's origin at the centre of its bounding box.",
        )  # fmt: skip


def _cache_file(shape: Shape, mesh: Any) -> Path | None:
    """Where the parts of this mesh are kept; None on a machine without a home."""
    import coacd

    try:
        root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None
    content = hashlib.sha256(np.ascontiguousarray(mesh.vertices).tobytes() + np.ascontiguousarray(mesh.faces).tobytes())
    content.update(f"{shape.parts} {CONCAVITY} {getattr(coacd, '__version__', '')}".encode())
    return root / "gap" / "convex" / f"{content.hexdigest()[:32]}.npz"


def _keep(file: Path, parts: list[Any]) -> None:
    """Best effort: a machine that cannot keep them computes them again."""
    arrays = {f"{key}{i}": part[k] for i, part in enumerate(parts) for k, key in enumerate("vf")}
    temporary = file.with_suffix(f".{os.getpid()}.npz")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez(temporary, **arrays)
        temporary.replace(file)
    except OSError:
        temporary.unlink(missing_ok=True)
