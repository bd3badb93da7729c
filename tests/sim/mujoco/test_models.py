"""Object models: collision geometry fills the stated size, visual geometry agrees with it, and no two look alike."""

from __future__ import annotations

from itertools import combinations

import mujoco
import numpy as np
import pytest

from gap_mujoco.model.compiled import compile_model, new_root
from gap_mujoco.model.models import render_objects
from gap_mujoco.model.primitives import COLLISION, VISUAL
from gap_mujoco.model.props import build_object, cavity
from gap_runtime.contracts.task import ObjectModel, Shape

pytestmark = pytest.mark.sim


def extents(model, group):
    """Half sizes of the box around all geoms of a group, in the object's frame."""
    corners = []
    for g in np.flatnonzero(model.geom_group == group):
        if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[g]
            rows = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
            R = np.zeros(9)
            mujoco.mju_quat2Mat(R, model.geom_quat[g])
            corners.append(model.mesh_vert[rows] @ R.reshape(3, 3).T + model.geom_pos[g])
        else:
            half = model.geom_size[g].copy()
            if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_CYLINDER:
                half = np.array([half[0], half[0], half[1]])
            corners.append(model.geom_pos[g] + np.array([-half, half]))
    points = np.concatenate(corners)
    return points.min(axis=0), points.max(axis=0)


@pytest.fixture(scope="module", params=["alphabet_soup", "bbq_sauce", "butter", "milk", "ketchup", "basket"])
def built(request, task):
    model = task.objects[request.param]
    return model, compile_free(request.param, model)


def compile_free(name, model):
    root = new_root("test", (16, 16), ())
    root.attach(build_object(name, model)).add("freejoint")
    return compile_model(root)


def test_felt_and_seen_fill_the_stated_size(built):
    model, compiled = built
    half = np.array(model.shape.size) / 2
    for group, tolerance in ((COLLISION, 1e-9), (VISUAL, 0.02 * half.max())):
        low, high = extents(compiled, group)
        assert np.allclose(low, -half, atol=tolerance) and np.allclose(high, half, atol=tolerance)


def test_the_mass_is_the_stated_one_and_only_primitives_touch(built):
    model, compiled = built
    assert compiled.body_mass.sum() == pytest.approx(model.mass)
    touching = compiled.geom_contype != 0
    assert {mujoco.mjtGeom(int(t)) for t in compiled.geom_type[touching]} <= {
        mujoco.mjtGeom.mjGEOM_BOX,
        mujoco.mjtGeom.mjGEOM_CYLINDER,
    }
    assert (compiled.geom_friction[touching, 0] == model.friction).all()


def test_the_baskets_cavity_is_free_and_walled_in(task):
    centre, half = cavity(task.objects["basket"].shape)
    model = compile_free("basket", task.objects["basket"])
    for g in np.flatnonzero(model.geom_group == COLLISION):
        apart = np.abs(model.geom_pos[g] - centre) - half - model.geom_size[g]
        assert apart.max() > -1e-9, "no wall reaches into the cavity"
    assert np.allclose(half[:2], 0.063)


@pytest.fixture(scope="module")
def views(task):
    return render_objects(task.objects, yaws_deg=(30,), elevations_deg=(35, 89.9), resolution=(96, 96))


def test_a_view_shows_the_object_and_nothing_else(task, views):
    assert len(views) == 2 * len(task.objects)
    for view in views:
        mask, depth, rgb = view.mask.data, view.observation.depth.data, view.observation.rgb.data
        assert 0.03 < mask.mean() < 0.6
        assert not mask[[0, -1]].any() and not mask[:, [0, -1]].any(), "all of it is in the picture"
        assert (depth[~mask] == 0).all() and (rgb[~mask] == 0).all()
        radius = np.linalg.norm(task.objects[view.name].shape.size) / 2
        assert np.abs(depth[mask] - view.distance).max() <= radius + 1e-3


def test_from_above_the_mask_is_the_footprint(task, views):
    for view in views:
        if view.elevation_deg < 80:
            continue
        shape, f = task.objects[view.name].shape, view.observation.intrinsics.data[0, 0]
        area = shape.size[0] * shape.size[1] * (np.pi / 4 if shape.kind == "cylinder" else 1)
        rows, cols = np.nonzero(view.mask.data)
        z = view.observation.depth.data[rows, cols]
        assert (z**2).sum() / f**2 == pytest.approx(area, rel=0.2), view.name


def test_no_two_objects_look_alike(task, views):
    pictures = {v.name: v.observation.rgb.data.astype(float) for v in views if v.elevation_deg < 80}
    for (a, seen), (b, other) in combinations(pictures.items(), 2):
        assert np.abs(seen - other).mean() > 3, (a, b)


def test_views_are_the_same_bytes_every_time(task, views):
    again = render_objects({"milk": task.objects["milk"]}, yaws_deg=(30,), elevations_deg=(35,), resolution=(96, 96))
    before = next(v for v in views if v.name == "milk" and v.elevation_deg < 80)
    assert again[0].observation.rgb == before.observation.rgb and again[0].mask == before.mask


def test_an_object_without_looks_is_plain():
    model = ObjectModel(label="x", shape=Shape(kind="cylinder", size=(0.1, 0.1, 0.1)), mass=1)
    assert render_objects({"thing": model}, yaws_deg=(0,), elevations_deg=(45,))[0].mask.data.any()
