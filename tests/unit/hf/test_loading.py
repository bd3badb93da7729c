"""Weights by folder or hub name; whatever is wrong with them is one sentence that says what to do."""

from __future__ import annotations

import shutil
import sys

import pytest
from safetensors.torch import load_file, save_file

from gap_hf import loading, settings
from gap_hf.loading import network
from gap_runtime.contracts.failures import ToolError

pytestmark = pytest.mark.usefixtures("fresh")


def load_sam2():
    return network("sam2", "Sam2Model")


def test_a_local_folder_is_loaded_once(serve):
    serve("sam2")
    first = load_sam2()
    assert load_sam2() is first
    assert not first.model.training
    loading.forget()
    assert load_sam2() is not first


def test_other_weights_are_another_network(serve, monkeypatch, tmp_path):
    folder = serve("sam2")
    first = load_sam2()
    shutil.copytree(folder, tmp_path / "copy")
    monkeypatch.setenv("GAP_HF_SAM2", str(tmp_path / "copy"))
    assert load_sam2() is not first


def test_a_folder_that_is_not_there(monkeypatch, tmp_path):
    monkeypatch.setenv("GAP_HF_SAM2", str(tmp_path / "nothing"))
    with pytest.raises(ToolError, match=r"GAP_HF_SAM2 names .*nothing, which is not a folder") as caught:
        load_sam2()
    assert caught.value.code == "weights"


def test_weights_that_were_never_fetched_say_how_to_fetch_them():
    with pytest.raises(ToolError, match=r"`hf download facebook/sam2\.1-hiera-large`.*GAP_HF_SAM2") as caught:
        load_sam2()
    assert caught.value.code == "weights"
    assert caught.value.__cause__ is None and caught.value.__suppress_context__


def test_an_empty_folder(monkeypatch, tmp_path):
    monkeypatch.setenv("GAP_HF_SAM2", str(tmp_path))
    with pytest.raises(ToolError, match="cannot be loaded") as caught:
        load_sam2()
    assert caught.value.code == "weights"


def test_another_architecture_is_refused(checkpoints, monkeypatch):
    monkeypatch.setenv("GAP_HF_SAM2", str(checkpoints("owl", generation=2)))
    with pytest.raises(ToolError, match="holds a owlv2 network, not sam2"):
        load_sam2()


def test_a_missing_tensor_is_refused_not_made_up(checkpoints, monkeypatch, tmp_path):
    damaged = tmp_path / "damaged"
    shutil.copytree(checkpoints("sam2"), damaged)
    tensors = load_file(damaged / "model.safetensors")
    lost = next(name for name in tensors if name.startswith("mask_decoder"))
    del tensors[lost]
    save_file(tensors, damaged / "model.safetensors", metadata={"format": "pt"})
    monkeypatch.setenv("GAP_HF_SAM2", str(damaged))
    with pytest.raises(ToolError, match=rf"lacks 1 tensors of Sam2Model, such as {lost}"):
        load_sam2()


def test_one_copy_of_sams_coordinate_matrix_is_enough(checkpoints, monkeypatch, tmp_path):
    """Older releases kept one tensor for the two places that use it."""
    folder = tmp_path / "older"
    shutil.copytree(checkpoints("sam2"), folder)
    tensors = load_file(folder / "model.safetensors")
    del tensors["prompt_encoder.shared_embedding.positional_embedding"]
    save_file(tensors, folder / "model.safetensors", metadata={"format": "pt"})
    monkeypatch.setenv("GAP_HF_SAM2", str(folder))
    model = load_sam2().model
    kept = tensors["shared_image_embedding.positional_embedding"]
    assert (model.prompt_encoder.shared_embedding.positional_embedding.cpu() == kept).all()


def test_a_broken_file(checkpoints, monkeypatch, tmp_path):
    broken = tmp_path / "broken"
    shutil.copytree(checkpoints("sam2"), broken)
    (broken / "model.safetensors").write_bytes(b"not tensors")
    monkeypatch.setenv("GAP_HF_SAM2", str(broken))
    with pytest.raises(ToolError, match="cannot be loaded") as caught:
        load_sam2()
    assert caught.value.detail["cause"].startswith("SafetensorError")


def test_without_the_extra_the_hint_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ToolError, match=r"pip install 'gap-cli\[hf\]'") as caught:
        load_sam2()
    assert caught.value.code == "extra"


@pytest.mark.parametrize(("name", "value"), [("DEVICE", "cuda:99"), ("DEVICE", "toaster"), ("DTYPE", "int8")])
def test_settings_that_cannot_be_met(serve, monkeypatch, name, value):
    serve("sam2")
    monkeypatch.setenv(f"GAP_HF_{name}", value)
    with pytest.raises(ToolError, match=f"GAP_HF_{name} is '{value}'") as caught:
        load_sam2()
    assert caught.value.code == "setting"


def test_every_service_has_a_published_default():
    assert all("/" in weights.default and weights.kinds for weights in settings.WEIGHTS.values())
