"""SAM 3 by text: every instance a phrase names, with masks and boxes in the image's pixels."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from gap_hf.device import compute_device
from gap_hf.loading import Network
from gap_hf.vision import concepts, segment
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(60, 100, (20, 10, 60, 30)))


class Finder(torch.nn.Module):
    """Finds a left half surely, a full frame unsurely and nothing else; masks are the boxes."""

    config = SimpleNamespace(vision_config=SimpleNamespace(image_size=112))
    boxes = ((0.0, 0.0, 0.5, 1.0), (0.0, 0.0, 1.0, 1.0), (0.2, 0.2, 0.3, 0.3))
    logits = (1.0, 4.0, -4.0)

    def forward(self, pixel_values, input_ids, attention_mask):
        assert pixel_values.shape == (1, 3, 112, 112) and input_ids.shape == (1, 32)
        device = pixel_values.device
        maps = torch.full((1, 3, 20, 20), -9.0, device=device)
        for i, (x0, y0, x1, y1) in enumerate(self.boxes):
            maps[0, i, int(y0 * 20) : int(y1 * 20), int(x0 * 20) : int(x1 * 20)] = 9.0
        return SimpleNamespace(
            pred_logits=torch.tensor([self.logits], device=device),
            presence_logits=torch.tensor([[3.0]], device=device),
            pred_boxes=torch.tensor([self.boxes], device=device),
            pred_masks=maps,
        )


@pytest.fixture
def finder(monkeypatch):
    place = compute_device()
    words = tiny.letters()
    monkeypatch.setattr(concepts, "network", lambda *_: Network(Finder().to(place.device), words, place))


def test_instances_are_scaled_to_the_image_and_ranked(finder, ctx):
    found = segment.sam3_segment_text(ctx, image=IMAGE, text_prompt="red can")
    assert found.boxes == [BoundingBox2D(0, 0, 100, 60), BoundingBox2D(0, 0, 50, 60)]
    assert found.masks[0].data.all()
    assert found.masks[1].data[:, :49].all() and not found.masks[1].data[:, 51:].any()
    present = 1 / (1 + np.exp(-3.0))
    assert found.scores == pytest.approx([present / (1 + np.exp(-4.0)), present / (1 + np.exp(-1.0))])


def test_nothing_sure_enough_is_nothing(finder, ctx, monkeypatch):
    monkeypatch.setattr(Finder, "logits", (-1.0, -2.0, -3.0))
    assert segment.sam3_segment_text(ctx, image=IMAGE, text_prompt="red can") == ([], [], [])


def test_the_network_runs_from_its_checkpoint(serve):
    serve("sam3")
    found = concepts.instances(IMAGE, "red can", threshold=0.0)
    assert 0 < len(found) <= 6
    assert [i.score for i in found] == sorted((i.score for i in found), reverse=True)
    assert all(i.mask.shape == (60, 100) and i.mask.any() for i in found)
    assert all(0 <= i.box.x_min <= i.box.x_max <= 100 and 0 <= i.box.y_min <= i.box.y_max <= 60 for i in found)


@pytest.mark.parametrize("text", ["", "  ", "a very long phrase with far more tokens than the encoder reads"])
def test_phrases_it_cannot_read_are_refused(finder, ctx, text):
    with pytest.raises(BadRequestError):
        segment.sam3_segment_text(ctx, image=IMAGE, text_prompt=text)
