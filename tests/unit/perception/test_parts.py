"""Parts are read from phrases and lie where the model says."""

from __future__ import annotations

import numpy as np
import pytest

from gap_perception.language.vocabulary import build_vocabulary
from gap_perception.parts import INSIDE, part_points, read_part
from gap_runtime.contracts.task import ObjectModel, Part, Shape

PAN = Shape(kind="pan", size=(0.35, 0.20, 0.05), wall=0.005, floor=0.005, handle=(0.03, 0.01))
MUG = Shape(kind="mug", size=(0.12, 0.085, 0.095), wall=0.004, floor=0.006, handle=(0.014, 0.008))
TRAY = Shape(kind="open_box", size=(0.3, 0.2, 0.05), wall=0.01, floor=0.01)
OBJECTS = {
    "frypan": ObjectModel(label="frying pan", words=["pan"], shape=PAN, mass=0.2),
    "mug": ObjectModel(label="mug", shape=MUG, mass=0.2),
}


@pytest.mark.parametrize(
    ("text", "part", "whole"),
    [
        ("handle of the frying pan", "handle", "frypan"),
        ("the frying pan's handle", "handle", "frypan"),
        ("mug rim", "rim", "mug"),
        ("the rim of the mug on the left", "rim", "mug"),
        ("Rim", "rim", None),
    ],
)
def test_a_part_and_what_it_belongs_to_are_read(text, part, whole):
    found = read_part(text, build_vocabulary(OBJECTS))
    assert found is not None and found[0] == part
    assert (found[1] and set(found[1].names)) == (whole and {whole})


@pytest.mark.parametrize("text", ["knob of the stove", "the stove's dial", "stove knob"])
def test_a_part_that_the_model_declares_is_read_by_its_words(text):
    shape = Shape(kind="box", size=(0.4, 0.2, 0.05))
    parts = {"knob": Part(center=(-0.1, 0, 0.02), size=(0.05, 0.05, 0.02), words=["dial"])}
    objects = {"stove": ObjectModel(label="stove", shape=shape, mass=3, parts=parts)}
    found = read_part(text, build_vocabulary(objects), objects)
    assert found is not None and found[0] == "knob" and found[1] is not None and set(found[1].names) == {"stove"}
    inside = part_points(objects["stove"], "knob")
    assert inside(np.array([[-0.1, 0.02, 0.02], [0.1, 0.0, 0.02]])).tolist() == [True, False]
    assert part_points(objects["stove"], "lid") is None


@pytest.mark.parametrize("text", ["frying pan", "handle of the unicorn", "door handle", ""])
def test_what_names_no_part_of_anything_known_is_none(text):
    assert read_part(text, build_vocabulary(OBJECTS)) is None


@pytest.mark.parametrize("shape", [PAN, MUG], ids=lambda s: s.kind)
def test_a_handle_is_what_sticks_out_and_no_rim(shape):
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (5000, 3)) * shape.size
    handle, rim = (INSIDE[part](shape)(points) for part in ("handle", "rim"))
    beyond = points[:, 0] > shape.size[1] - shape.size[0] / 2 + (shape.wall or 0.0)  # past the round body
    assert beyond.any() and handle[beyond].all()
    assert rim.any() and not (handle & rim).any()


def test_only_what_has_the_part_has_it():
    box = Shape(kind="box", size=(0.1, 0.1, 0.1))
    assert INSIDE["handle"](TRAY) is None and INSIDE["handle"](box) is None
    assert INSIDE["rim"](TRAY) is not None and INSIDE["rim"](box) is None
