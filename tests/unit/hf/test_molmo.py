"""Molmo 2 from a tiny checkpoint: images and prompts become its inputs, its words become answers."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_catalogue.shared.frames import remember
from gap_hf.language import generation, molmo
from gap_runtime.contracts.failures import BadRequestError, CancelledError, PerceptionError
from gap_runtime.contracts.types import (
    CameraObservation,
    DepthImage,
    Image,
    Matrix3x3,
    Observation,
    Quaternion,
    Se3Pose,
    Vec3,
)
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(40, 60))


@pytest.fixture
def net(serve, monkeypatch):
    serve("molmo")
    monkeypatch.setattr(generation, "MAX_NEW_TOKENS", 6)
    return generation.load()


@pytest.fixture
def says(monkeypatch):
    """Make Molmo answer a text; returns the questions and images it was given."""
    asked = []

    def prepare(text):
        def reply(ctx, prompt, images):
            asked.append((prompt, images))
            return text

        monkeypatch.setattr(generation, "reply", reply)
        return asked

    return prepare


def observe(ctx, *images):
    pose = Se3Pose(Vec3(0, 0, 1), Quaternion(1, 0, 0, 0))
    cameras = tuple(
        CameraObservation(f"c{i}", im, DepthImage(np.ones(im.data.shape[:2], np.float32)), Matrix3x3(np.eye(3)), pose)
        for i, im in enumerate(images)
    )
    remember(ctx.state, Observation(cameras, ()))


def test_a_query_is_answered_and_always_alike(net, ctx):
    first = molmo.molmo_query(ctx, prompt="What is this?", image=IMAGE).text
    assert isinstance(first, str)
    assert molmo.molmo_query(ctx, prompt="What is this?", image=IMAGE).text == first


def test_every_image_patch_has_its_token(net):
    inputs = generation.prepare(net, "hi", [IMAGE, IMAGE])
    patches = (inputs["input_ids"] == net.model.config.image_patch_id).sum()
    low, high = inputs["image_grids"][:, :2].prod(dim=1), inputs["image_grids"][:, 2:].prod(dim=1)
    assert patches == (low + high).sum()
    assert len(inputs["image_num_crops"]) == 2
    assert inputs["pixel_values"].dtype == net.place.dtype


def test_the_overview_shows_the_whole_image(net):
    """The first crop is the image on one square: patches in rows, pixels normalised to -1 .. 1."""
    left = np.zeros((40, 60, 3), np.uint8)
    left[:, :30] = 255
    pixels = generation.prepare(net, "hi", [Image(left)])["pixel_values"][0].float().cpu()
    means = pixels.mean(dim=1).view(4, 4)
    assert (means[:, :2] > 0.9).all() and (means[:, 2:] < -0.9).all()


def test_a_cancelled_node_stops_between_two_tokens(net):
    def cancelled():
        raise CancelledError("stop")

    with pytest.raises(CancelledError):
        molmo.molmo_query(SimpleNamespace(state={}, raise_if_cancelled=cancelled), prompt="hi", image=IMAGE)


def test_a_point_falls_on_the_images_pixels(says, ctx):
    asked = says('<points coords="1 1 500 250">red can</points>')
    assert molmo.molmo_point_prompt(ctx, image=IMAGE, object_name="red can") == (30, 10, True)
    assert asked == [("Point to the red can.", [IMAGE])]


def test_no_point_is_not_found(says, ctx):
    says("There are none.")
    assert molmo.molmo_point_prompt(ctx, image=IMAGE, object_name="red can") == (0, 0, False)


@pytest.mark.parametrize(("text", "want"), [("Yes.", True), ("no", False), ("**Yes**, it is", True)])
def test_yes_and_no(says, ctx, text, want):
    says(text)
    assert molmo.molmo_query_yes_no(ctx, prompt="Is it?", image=IMAGE).answer is want


def test_another_answer_is_neither(says, ctx):
    says("Possibly")
    with pytest.raises(PerceptionError, match="neither yes nor no"):
        molmo.molmo_query_yes_no(ctx, prompt="Is it?", image=IMAGE)


def test_without_an_image_the_latest_observation_is_meant(says, ctx):
    asked, other = says("a can"), Image(tiny.picture(40, 60, seed=1))
    with pytest.raises(BadRequestError, match="no image"):
        molmo.molmo_query(ctx, prompt="What?")
    observe(ctx, IMAGE, other)
    molmo.molmo_query(ctx, prompt="What?")
    molmo.molmo_query(ctx, prompt="What?", image=other, use_multiview=True)
    assert [images for _, images in asked] == [[IMAGE], [IMAGE, other]]


@pytest.mark.parametrize("prompt", ["", "  ", "x" * 9000])
def test_prompts_it_will_not_read(ctx, prompt):
    with pytest.raises(BadRequestError, match="characters"):
        molmo.molmo_query(ctx, prompt=prompt, image=IMAGE)


def test_an_unnamed_object(ctx):
    with pytest.raises(BadRequestError, match="empty"):
        molmo.molmo_point_prompt(ctx, image=IMAGE, object_name=" ")
