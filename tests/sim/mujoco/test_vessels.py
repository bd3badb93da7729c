"""Pans and mugs: as large as they say, hollow, and with something to hold them by."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from gap_mujoco.model.compiled import compile_model, new_root
from gap_mujoco.model.models import render_objects
from gap_mujoco.model.primitives import COLLISION, CollisionPrimitive
from gap_mujoco.model.props import build_object, cavity, collision_primitives
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.task import ObjectModel, Shape

pytestmark = pytest.mark.sim
SHAPES = {
    "pan": Shape(kind="pan", size=(0.356, 0.204, 0.058), wall=0.005, floor=0.006, handle=(0.025, 0.012)),
    "mug": Shape(kind="mug", size=(0.12, 0.085, 0.095), wall=0.004, floor=0.006, handle=(0.014, 0.008)),
}


@pytest.fixture(params=SHAPES)
def model(request):
    return ObjectModel(label=request.param, shape=SHAPES[request.param], mass=0.2)


def corners(part: CollisionPrimitive):
    half = np.array([part.size[0], part.size[0], part.size[1]] if part.kind == "cylinder" else part.size)
    signs = np.stack(np.meshgrid(*[[-1, 1]] * 3), -1).reshape(-1, 3)
    c, s = np.cos(part.yaw), np.sin(part.yaw)
    return (signs * half) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T + part.centre


def compiled(model):
    root = new_root("test", (16, 16), ())
    root.attach(build_object("thing", model)).add("freejoint")
    return compile_model(root)


def test_it_fills_the_stated_size(model):
    points = np.concatenate([corners(p) for p in collision_primitives(model.shape, None)])
    half = np.array(model.shape.size) / 2
    np.testing.assert_allclose(points.max(axis=0), half, atol=1e-3)
    np.testing.assert_allclose(points.min(axis=0), -half, atol=1e-3)


def test_its_cavity_is_free_and_its_mass_the_stated_one(model):
    centre, half = cavity(model.shape)
    rng = np.random.default_rng(0)
    inside = centre + rng.uniform(-1, 1, (500, 3)) * half * 0.99
    for part in collision_primitives(model.shape, None):
        c, s = np.cos(part.yaw), np.sin(part.yaw)
        local = (inside - part.centre) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        if part.kind == "box":
            assert not (np.abs(local) < np.array(part.size) - 1e-9).all(axis=1).any()
        else:
            assert not (
                (np.hypot(local[:, 0], local[:, 1]) < part.size[0]) & (np.abs(local[:, 2]) < part.size[1])
            ).any()
    assert compiled(model).body_mass.sum() == pytest.approx(model.mass)


def test_visual_and_collision_geometry_are_the_same(model):
    built = compiled(model)
    seen = mujoco.mj_id2name(built, mujoco.mjtObj.mjOBJ_BODY, 1)
    assert seen.startswith("thing")
    assert (built.geom_group == COLLISION).sum() * 2 == built.ngeom
    assert render_objects({"thing": model}, yaws_deg=(0,), elevations_deg=(40,))[0].mask.data.any()


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"handle": None}, "handle"),
        ({"wall": None}, "wall"),
        ({"size": (0.1, 0.1, 0.1)}, "size.0: 0.1 should be greater than 0.1"),
        ({"kind": "box"}, "wall"),
    ],
)
def test_a_vessel_that_cannot_be_is_refused(changes, why):
    with pytest.raises(DocumentError, match=why):
        Shape.load(SHAPES["mug"].model_dump() | changes, "shape")
