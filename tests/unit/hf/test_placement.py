"""Half precision where it saves time, full precision for coordinates."""

from __future__ import annotations

import pytest
import torch

from gap_hf.device import EXACT, ComputeDevice, compute_device, computing, keep_exact
from gap_hf.vision.promptable_segmentation import SAM2, Prompt, prompts
from tests.unit.hf import tiny

HALF = ComputeDevice(torch.device("cpu"), torch.bfloat16)


def test_the_processor_computes_in_full_precision(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.delenv("GAP_HF_DEVICE", raising=False)
    monkeypatch.delenv("GAP_HF_DTYPE", raising=False)
    assert compute_device() == ComputeDevice(torch.device("cpu"), torch.float32)


@pytest.mark.parametrize(("bf16", "dtype"), [(True, torch.bfloat16), (False, torch.float16)])
def test_a_gpu_computes_in_the_half_precision_it_has(monkeypatch, bf16, dtype):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda: bf16)
    monkeypatch.delenv("GAP_HF_DEVICE", raising=False)
    monkeypatch.delenv("GAP_HF_DTYPE", raising=False)
    assert compute_device() == ComputeDevice(torch.device("cuda"), dtype)


def test_the_environment_decides(monkeypatch):
    monkeypatch.setenv("GAP_HF_DEVICE", "cpu")
    monkeypatch.setenv("GAP_HF_DTYPE", "bfloat16")
    assert compute_device() == HALF


def test_prompts_keep_their_place_in_half_precision(serve, fresh):
    serve("sam2")
    from gap_runtime.contracts.types import Image

    model = SAM2.load().model.cpu()
    image = Image(tiny.picture(480, 640))
    given = prompts(SAM2.square(model), image, Prompt(box=(601.0, 3.0, 605.0, 477.0)), "cpu")
    with computing(ComputeDevice(torch.device("cpu"), torch.float32)):
        want, _ = model.prompt_encoder(input_points=None, input_labels=None, input_masks=None, **given)
    with computing(HALF):
        kept, _ = model.prompt_encoder(input_points=None, input_labels=None, input_masks=None, **given)
    assert torch.equal(kept, want)
    assert kept.dtype == torch.float32


def test_only_coordinate_parts_are_kept_exact():
    class Net(torch.nn.Module):
        def __init__(self):
            super().__init__()
            self.trunk = torch.nn.Linear(4, 4)
            self.bbox_embed = torch.nn.ModuleList([torch.nn.Linear(4, 4)])

    net = Net()
    keep_exact(net)
    with computing(HALF):
        assert net.trunk(torch.ones(1, 4)).dtype == torch.bfloat16
        assert net.bbox_embed[0](torch.ones(1, 4, dtype=torch.bfloat16)).dtype == torch.float32
    assert "bbox_embed" in EXACT
