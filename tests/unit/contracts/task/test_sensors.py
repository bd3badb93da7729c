"""Noise models: off by default, refused by path when they make no sense, told apart by camera."""

from __future__ import annotations

import math

import pytest

from gap_runtime.contracts.failures import DocumentError
from gap_runtime.contracts.task.sensors import CameraNoise, Sensors, StereoDepth

DEPTH = {"baseline": 0.05, "focal": 400.0, "subpixel": 0.1}


def load(noise, **more):
    return Sensors.load({"models": {"real": noise}, **more}, "task.yaml")


def test_there_is_no_noise_unless_asked_for():
    assert Sensors().by_camera(["a", "b"], "task.yaml") == {}
    assert load({"depth": DEPTH}).by_camera(["a"], "task.yaml") == {}
    assert CameraNoise() == CameraNoise(depth=None, colour=0, light=0, shift=0, turn=0)


def test_a_model_is_for_all_cameras_or_for_one():
    everywhere, one = load({"colour": 2}, use="real"), load({"colour": 2}, use={"b": "real"})
    assert set(everywhere.by_camera(["a", "b"], "")) == {"a", "b"}
    assert dict(one.by_camera(["a", "b"], "")) == {"b": CameraNoise(colour=2)}


def test_depth_noise_grows_with_the_square_of_depth():
    depth = StereoDepth.load(DEPTH, "")
    assert depth.deviation(2.0) == pytest.approx(4 * depth.deviation(1.0)) == pytest.approx(4 * 0.1 / (400 * 0.05))


@pytest.mark.parametrize("bad", [-1e-9, math.nan, math.inf, "much", None])
@pytest.mark.parametrize("key", ["colour", "light", "shift", "turn"])
def test_amounts_are_finite_and_not_negative(key, bad):
    with pytest.raises(DocumentError, match=rf"^task.yaml: models.real.{key}: "):
        load({key: bad})


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
@pytest.mark.parametrize("key", ["baseline", "focal", "subpixel", "grain", "jitter", "dropout", "unit"])
def test_so_are_those_of_depth(key, bad):
    with pytest.raises(DocumentError, match=rf"^task.yaml: models.real.depth.{key}: "):
        load({"depth": DEPTH | {key: bad}})


@pytest.mark.parametrize(("key", "bad"), [("dropout", 1.0), ("baseline", 0), ("focal", 0), ("grain", 1e9)])
def test_limits_of_sense_hold(key, bad):
    with pytest.raises(DocumentError, match=key):
        load({"depth": DEPTH | {key: bad}})


def test_an_unknown_key_is_named_with_the_one_meant():
    with pytest.raises(DocumentError, match=r"models.real.color: is not a known key.*colour"):
        load({"color": 1})


def test_an_unknown_model_is_named_with_the_one_meant():
    for use, path in (("reel", "use: 'reel'"), ({"wrist": "reel"}, "use.wrist: 'reel'")):
        with pytest.raises(DocumentError, match=path + ".*Did you mean 'real'"):
            load({}, use=use)


def test_an_unknown_camera_is_named_with_the_one_meant():
    with pytest.raises(DocumentError, match=r"^task.yaml: sensors.use.wirst: is not a camera Did you mean 'wrist'"):
        load({}, use={"wirst": "real"}).by_camera(["agentview", "wrist"], "task.yaml")
