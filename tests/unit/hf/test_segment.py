"""SAM 2 and SAM 3 by box and point: prompts land where they point, masks come back in the image's pixels."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from gap_hf.device import compute_device
from gap_hf.loading import Network
from gap_hf.vision import promptable_segmentation as prompted
from gap_hf.vision import segment
from gap_hf.vision.pixels import bounds
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(60, 100, (20, 10, 60, 30)))
SERVICES = ["sam2", "sam3"]
SIDES = {"sam2": tiny.SIDE_2, "sam3": tiny.SIDE_3}


def by_box(service, ctx, box, **options):
    tool = {"sam2": segment.sam2_segment_box, "sam3": segment.sam3_segment_box}[service]
    return tool(ctx, image=IMAGE, box=BoundingBox2D(*box), **options)


def by_point(service, ctx, x, y):
    tool = {"sam2": segment.sam2_segment_point, "sam3": segment.sam3_segment_point}[service]
    return tool(ctx, image=IMAGE, pixel_x=x, pixel_y=y)


class Painter(torch.nn.Module):
    """Answers with what it was shown: the prompted box painted, and the bright pixels of the image."""

    side = 128

    def __init__(self):
        super().__init__()
        self.config = SimpleNamespace(prompt_encoder_config=SimpleNamespace(image_size=self.side))

    def forward(self, pixel_values, multimask_output, input_boxes=None, input_points=None, input_labels=None):
        assert pixel_values.shape == (1, 3, self.side, self.side)
        bright = torch.nn.functional.avg_pool2d(pixel_values.mean(dim=1, keepdim=True), 4)[0]
        painted = torch.full((1, 32, 32), -10.0, device=pixel_values.device)
        if input_boxes is not None:
            x0, y0, x1, y1 = (input_boxes[0, 0] / 4).round().int().tolist()
            painted[:, y0:y1, x0:x1] = 10.0
        if input_points is not None:
            assert input_labels.tolist() == [[[1]]]
            x, y = (input_points[0, 0, 0] / 4).int().tolist()
            painted[:, max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = 10.0
        masks = torch.cat([bright, painted])[None, None]
        return SimpleNamespace(pred_masks=masks, iou_scores=torch.tensor([[[0.3, 1.2]]], device=masks.device))


@pytest.fixture
def painter(monkeypatch):
    place = compute_device()
    monkeypatch.setattr(prompted, "network", lambda *_: Network(Painter().to(place.device), None, place))


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize("box", [(0, 0, 100, 60), (20, 10, 60, 30), (75, 40, 100, 60), (3.5, 7.25, 30.5, 50)])
def test_a_box_comes_back_where_it_was(painter, ctx, service, box):
    best, bright = by_box(service, ctx, box).masks
    pixel = np.array([100, 60, 100, 60]) / 32  # of the painted map, in pixels of the image
    found = bounds(best.data)
    assert (np.abs(np.array([found.x_min, found.y_min, found.x_max, found.y_max]) - box) <= pixel / 2 + 1).all()
    seen = bounds(bright.data)
    assert (
        np.abs(np.array([seen.x_min, seen.y_min, seen.x_max, seen.y_max]) - (20, 10, 60, 30)) <= pixel / 2 + 1
    ).all()


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize(("x", "y"), [(0, 0), (99, 59), (50, 5), (12, 44)])
def test_a_point_lies_in_what_it_points_at(painter, ctx, service, x, y):
    best = by_point(service, ctx, x, y).masks[0]
    ys, xs = np.nonzero(best.data)
    assert best.data[y, x]
    assert np.abs(xs - x).max() <= 2 * 100 / 32 + 1 and np.abs(ys - y).max() <= 2 * 60 / 32 + 1


def test_scores_are_clipped_and_best_first(painter, ctx):
    assert by_box("sam2", ctx, (20, 10, 60, 30)).scores == [1.0, pytest.approx(0.3)]


@pytest.mark.parametrize("service", SERVICES)
def test_the_networks_run_from_their_checkpoints(serve, ctx, service):
    folder = serve(service)
    assert folder.is_dir()
    found = by_box(service, ctx, (20, 10, 60, 30))
    assert 0 < len(found.masks) == len(found.scores) <= 3
    assert found.scores == sorted(found.scores, reverse=True)
    assert all(mask.data.shape == (60, 100) and mask.data.any() for mask in found.masks)
    assert by_box(service, ctx, (20, 10, 60, 30)) == found, "the same frame gives the same masks"


@pytest.mark.parametrize(("service", "architecture"), [("sam2", "Sam2Model"), ("sam3", "Sam3TrackerModel")])
def test_the_network_is_given_the_box_in_its_own_pixels(serve, ctx, service, architecture):
    from gap_hf.loading import network

    serve(service)
    heard = []
    encoder = network(service, architecture).model.prompt_encoder
    hook = encoder.register_forward_pre_hook(lambda *a: heard.append(a[2]), with_kwargs=True)
    try:
        by_box(service, ctx, (20, 10, 60, 30), **({"use_point": True, "pixel_x": 50} if service == "sam3" else {}))
    finally:
        hook.remove()
    side = SIDES[service]
    (given,) = heard
    want = torch.tensor([20 / 100, 10 / 60, 60 / 100, 30 / 60]) * side
    assert torch.allclose(given["input_boxes"].cpu(), want.view(1, 1, 4))
    if service == "sam3":
        assert torch.allclose(given["input_points"].cpu(), torch.tensor([50 / 100 * side, 0.0]).view(1, 1, 1, 2))
        assert given["input_labels"].tolist() == [[[1]]]


def test_no_more_masks_than_asked_for(serve, ctx):
    serve("sam2")
    assert len(by_box("sam2", ctx, (20, 10, 60, 30), max_masks=1).masks) <= 1
    assert len(by_box("sam2", ctx, (20, 10, 60, 30), max_masks=2).masks) <= 2


@pytest.mark.parametrize("service", SERVICES)
def test_prompts_outside_the_image_are_refused_before_anything_is_loaded(ctx, service):
    with pytest.raises(BadRequestError, match="outside"):
        by_point(service, ctx, 100, 5)
    with pytest.raises(BadRequestError, match="outside"):
        by_box(service, ctx, (120, 5, 130, 9))
    with pytest.raises(BadRequestError, match="no area"):
        by_box(service, ctx, (20, 5, 20, 9))


def test_a_large_image_keeps_its_size(serve, ctx):
    serve("sam2")
    large = Image(tiny.picture(2160, 3840, (1000, 500, 2000, 900)))
    found = segment.sam2_segment_box(ctx, image=large, box=BoundingBox2D(1000, 500, 2000, 900), max_masks=1)
    assert all(mask.data.shape == (2160, 3840) for mask in found.masks)
