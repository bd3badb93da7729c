"""Our preprocessing beside transformers' own, where torchvision lets it run: the same numbers go into the networks."""

from __future__ import annotations

import numpy as np
import pytest
import torch

pytest.importorskip("torchvision")

from gap_hf.language import generation
from gap_hf.vision import concepts
from gap_hf.vision import promptable_segmentation as prompted
from gap_hf.vision.pixels import to_array, to_image
from gap_runtime.contracts.types import Image
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(60, 100))
BOX = (20.0, 10.0, 60.0, 30.0)


def processor(family, side):
    import transformers

    size = {"height": side, "width": side}
    if family is prompted.SAM2:
        return transformers.Sam2Processor(transformers.Sam2ImageProcessor(size=size))
    return transformers.Sam3TrackerProcessor(transformers.Sam3ImageProcessor(size=size))


@pytest.mark.parametrize("family", [prompted.SAM2, prompted.SAM3], ids=lambda f: f.service)
def test_promptable_networks_get_what_the_library_would_give_them(serve, family):
    serve(family.service)
    model = family.load().model
    square = family.square(model)
    theirs = processor(family, square.side)(images=np.array(IMAGE.data), input_boxes=[[list(BOX)]], return_tensors="pt")
    ours = square.pixels(IMAGE, "cpu")
    step = 1.01 / 255 / min(square.std)  # theirs is rounded to bytes between the two directions, ours once
    assert (theirs["pixel_values"] - ours).abs().max() <= step
    assert (theirs["pixel_values"] - ours).abs().mean() <= step / 4
    given = prompted.prompts(square, IMAGE, prompted.Prompt(box=BOX), "cpu")
    assert torch.allclose(theirs["input_boxes"], given["input_boxes"])


@pytest.mark.parametrize("family", [prompted.SAM2, prompted.SAM3], ids=lambda f: f.service)
def test_masks_are_stretched_as_the_library_does(serve, family):
    logits = torch.randn(1, 3, 32, 32, generator=torch.Generator().manual_seed(0))
    (theirs,) = processor(family, 128).post_process_masks([logits], [[60, 100]])
    assert np.array_equal(to_array(theirs)[0], to_array(to_image(logits[0], IMAGE) > 0))


def test_named_instances_are_the_librarys(serve):
    import transformers

    serve("sam3")
    loaded = concepts.load()
    heard = []
    hook = loaded.model.register_forward_hook(lambda model, inputs, output: heard.append(output))
    try:
        ours = concepts.instances(IMAGE, "red can", threshold=0.0)
    finally:
        hook.remove()
    (outputs,) = heard
    for name in ("pred_logits", "pred_boxes", "pred_masks", "presence_logits"):
        outputs[name] = outputs[name].float()  # as we read them; in half precision many a pixel is exactly undecided
    images = transformers.Sam3ImageProcessor()
    (theirs,) = images.post_process_instance_segmentation(outputs, threshold=0.0, target_sizes=[(60, 100)])
    shown = theirs["masks"].flatten(1).any(dim=1)
    order = theirs["scores"][shown].float().argsort(descending=True, stable=True)
    assert [i.score for i in ours] == pytest.approx(theirs["scores"][shown][order].tolist())
    for mine, box, mask in zip(ours, theirs["boxes"][shown][order], theirs["masks"][shown][order], strict=True):
        corners = [mine.box.x_min, mine.box.y_min, mine.box.x_max, mine.box.y_max]
        cut = np.clip(to_array(box.float()), 0, (100, 60, 100, 60))
        assert np.allclose(corners, cut, atol=1e-3)
        assert np.array_equal(to_array(mask.bool()), mine.mask)


def test_molmo_gets_what_the_library_would_give_it(serve):
    from transformers.models.molmo2.image_processing_molmo2 import Molmo2ImageProcessor

    folder = serve("molmo")
    loaded = generation.load()
    theirs = Molmo2ImageProcessor.from_pretrained(folder)(images=[np.array(IMAGE.data)], return_tensors="pt")
    ours = generation.prepare(loaded, "hi", [IMAGE])
    for name in ("image_token_pooling", "image_grids", "image_num_crops"):
        assert torch.equal(theirs[name], ours[name].cpu()), name
    assert (theirs["pixel_values"] - ours["pixel_values"].cpu().float()).abs().max() <= 2.02 / 255
