"""Perception reads pixels and models: never the simulator; the same frames give the same bytes; bad input is named."""

from dataclasses import replace

import numpy as np
import pytest

from gap_catalogue.shared.frames import remember
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.encoding.codec import to_plain
from gap_runtime.contracts.failures import BadRequestError, PrivilegedReadError, ToolError, UnknownNameError
from gap_runtime.contracts.types import BoundingBox2D, DepthImage, Image, Observation

pytestmark = pytest.mark.sim


class BlindWorld:
    """A world that shows its sensors and nothing else: any other access fails the test."""

    def __init__(self, world):
        self._observation, self.camera_names = world.observe(), world.camera_names
        self.camera_pose = world.camera_pose

    def observe(self, cameras=None):
        return self._observation

    def __getattr__(self, name):
        raise AssertionError(f"perception touched world.{name}")


CALLS = [
    ("observation.GetCameraPose", {"camera_name": "agentview"}),
    ("grounding_dino.Detect", {"image": True, "text_prompt": "basket. can left of the basket."}),
    ("owlvit.Detect", {"image": True, "text_queries": ["grocery"]}),
    ("sam2.SegmentBox", {"image": True, "box": BoundingBox2D(300, 150, 500, 350)}),
    ("sam2.SegmentPoint", {"image": True, "pixel_x": 400, "pixel_y": 250}),
    ("sam3.SegmentBox", {"image": True, "box": BoundingBox2D(300, 150, 500, 350)}),
    ("sam3.SegmentPoint", {"image": True, "pixel_x": 400, "pixel_y": 250}),
    ("sam3.SegmentText", {"image": True, "text_prompt": "basket"}),
    ("molmo.PointPrompt", {"image": True, "object_name": "basket"}),
    ("molmo.Query", {"prompt": "What objects are visible?", "image": True, "use_multiview": True}),
    ("vlm.Query", {"prompt": "How many cans are there?", "image": True}),
    ("vlm.QueryYesNo", {"prompt": "Is there a basket?", "image": True}),
]


def run(cell, observation):
    """Everything perception says about an observation, as plain data."""
    image = observation.cameras[0].rgb
    return [
        to_plain(cell.tool(name, **{k: image if v is True and k == "image" else v for k, v in inputs.items()}))
        for name, inputs in CALLS
    ]


def test_no_provider_reads_simulator_state_and_the_same_frames_give_the_same_answers(cell, present):
    blind = replace(cell, cell=BlindWorld(cell.cell), state={})
    with node_scope("policy"):
        with pytest.raises(PrivilegedReadError):
            cell.cell.snapshot()
        blind.tool("observation.GetObservation")
        first = run(blind, blind.cell.observe())
        blind.state.clear()
        blind.tool("observation.GetObservation")
        assert run(blind, blind.cell.observe()) == first


@pytest.fixture
def image(cameras):
    return cameras[0].rgb


@pytest.mark.parametrize(
    ("tool", "inputs"),
    [
        ("grounding_dino.Detect", {"text_prompt": " . "}),
        ("grounding_dino.Detect", {"text_prompt": "basket", "box_threshold": float("nan")}),
        ("grounding_dino.Detect", {"text_prompt": "basket", "text_threshold": 2.0}),
        ("owlvit.Detect", {"text_queries": []}),
        ("sam3.SegmentText", {"text_prompt": ""}),
        ("sam3.SegmentPoint", {"pixel_x": -1, "pixel_y": 0}),
        ("sam2.SegmentPoint", {"pixel_x": 0, "pixel_y": 10**6}),
        ("sam3.SegmentBox", {"box": BoundingBox2D(10, 10, 10, 20)}),
        ("sam3.SegmentBox", {"box": BoundingBox2D(float("nan"), 10, 20, 20)}),
        ("sam3.SegmentBox", {"box": BoundingBox2D(5000, 5000, 6000, 6000)}),
        ("sam3.SegmentBox", {"box": BoundingBox2D(1, 1, 9, 9), "pixel_x": 9999, "use_point": True}),
        ("sam2.SegmentBox", {"box": BoundingBox2D(1, 1, 9, 9), "max_masks": -1}),
        ("molmo.PointPrompt", {"object_name": " "}),
        ("vlm.Query", {"prompt": ""}),
        ("vlm.QueryYesNo", {"prompt": "x" * 10**5}),
    ],
)
def test_arguments_outside_the_contract_are_refused(cell, image, tool, inputs):
    with pytest.raises(BadRequestError):
        cell.tool(tool, image=image, **inputs)


def test_an_unknown_camera_is_named(cell, cameras):
    with pytest.raises(UnknownNameError, match="agentvie"):
        cell.tool("observation.GetCameraPose", camera_name="agentvie")


def test_a_question_without_any_image_is_refused(cell, present):
    cell.state.clear()
    with pytest.raises(BadRequestError, match="no image"):
        cell.tool("vlm.Query", prompt="Is there a basket?").text


@pytest.mark.parametrize("fill", [0.0, np.nan, np.inf, -1.0])
def test_frames_without_depth_are_judged_by_colour(cell, cameras, fill):
    blank = tuple(replace(c, depth=DepthImage(np.full(c.depth.data.shape, fill, np.float32))) for c in cameras)
    cell.state.clear()
    remember(cell.state, Observation(blank, ()))
    found = cell.tool("grounding_dino.Detect", image=cameras[1].rgb, text_prompt="basket.").detections
    assert found and found[0].score < 0.7


def test_objects_whose_depth_is_missing_are_lost_and_the_others_kept(cell, cameras, present):
    half = cameras[0].rgb.data.shape[1] // 2
    torn = []
    for c in cameras:
        depth = c.depth.data.copy()
        depth[:, :half] = np.nan
        torn.append(replace(c, depth=DepthImage(depth)))

    def boxes(frames):
        cell.state.clear()
        remember(cell.state, Observation(tuple(frames), ()))
        ask = {name: model.label for name, model in cell.task.objects.items()}
        found = {n: cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt=t) for n, t in ask.items()}
        return {name: [d.box for d in answer.detections] for name, answer in found.items()}

    whole, seen = boxes(cameras), boxes(torn)
    kept = [n for n in present if min(b.x_min for b in whole[n]) >= half]
    assert 0 < len(kept) < len(present) and all(seen[n] == [] for n in seen.keys() - present)
    assert all(b.x_min >= half for found in seen.values() for b in found)
    for name in kept:
        assert any(b.x_min == pytest.approx(whole[name][0].x_min, abs=3) for b in seen[name]), name


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((480, 640, 3), np.uint8),
        np.full((480, 640, 3), 255, np.uint8),
        np.repeat(np.random.default_rng(0).integers(0, 255, (480, 640, 1), np.uint8), 3, axis=2),
        np.random.default_rng(1).integers(0, 255, (2160, 3840, 3), np.uint8),
        np.random.default_rng(2).integers(0, 255, (8, 8, 3), np.uint8),
    ],
    ids=["black", "white", "grey noise", "4K noise", "tiny"],
)
def test_pictures_of_nothing_show_nothing(cell, pixels):
    image = Image(pixels)
    assert cell.tool("grounding_dino.Detect", image=image, text_prompt="alphabet soup. basket.").detections == []
    assert cell.tool("molmo.PointPrompt", image=image, object_name="basket").found is False
    assert cell.tool("vlm.Query", prompt="How many cans are there?", image=image).text == "0"


@pytest.mark.parametrize("shape", [(0, 5, 3), (1, 1, 3), (2, 4000, 3), (9000, 16, 3)])
def test_an_image_of_no_use_is_refused(cell, shape):
    with pytest.raises(BadRequestError, match="pixels"):
        cell.tool("grounding_dino.Detect", image=Image(np.zeros(shape, np.uint8)), text_prompt="basket")


def test_a_broken_frame_is_refused_by_name(cell, cameras):
    short = replace(cameras[0], depth=DepthImage(np.ones((10, 10), np.float32)))
    cell.state.clear()
    remember(cell.state, Observation((short,), ()))
    with pytest.raises(ToolError, match="agentview"):
        cell.tool("grounding_dino.Detect", image=short.rgb, text_prompt="basket").detections
