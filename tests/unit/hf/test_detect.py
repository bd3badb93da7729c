"""Grounding DINO and OWL by their own checkpoints: boxes in pixels, labels as asked, thresholds as said."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from gap_hf.loading import network
from gap_hf.vision import detect
from gap_hf.vision.grounding import assign_phrases
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image
from tests.unit.hf import tiny

IMAGE = Image(tiny.picture(60, 100))
KINDS = ["grounding_dino", "owl1", "owl2"]


@pytest.fixture(params=KINDS)
def kind(request, serve):
    if request.param == "grounding_dino":
        serve("grounding_dino")
    else:
        serve("owlvit", "owl", generation=int(request.param[-1]))
    return request.param


def find(kind, ctx, phrases, threshold, image=IMAGE):
    if kind == "grounding_dino":
        found = detect.grounding_dino_detect(
            ctx, image=image, text_prompt=". ".join(phrases) + ".", box_threshold=threshold, text_threshold=0.0
        )
    else:
        found = detect.owlvit_detect(ctx, image=image, text_queries=phrases, score_threshold=threshold)
    return found.detections


def loaded(kind):
    if kind == "grounding_dino":
        return network("grounding_dino", "GroundingDinoForObjectDetection", "AutoProcessor")
    return network("owlvit", "AutoModelForZeroShotObjectDetection", "AutoProcessor")


class Answer:
    """Makes a loaded network find one box (cx, cy, w, h of its input) for the token or query given, surely."""

    def __init__(self, kind, box, index):
        self.model, self.box, self.index = loaded(kind).model, box, index

    def __enter__(self):
        self.hook = self.model.register_forward_hook(self.answer)

    def __exit__(self, *_):
        self.hook.remove()

    def answer(self, model, inputs, output):
        output.logits = torch.full_like(output.logits, -20.0)
        output.logits[0, 3, self.index] = 5.0
        output.pred_boxes = torch.zeros_like(output.pred_boxes)
        output.pred_boxes[0, 3] = torch.tensor(self.box)
        return output


def test_boxes_lie_in_the_image_and_are_labelled_with_what_was_asked(kind, ctx):
    found = find(kind, ctx, ["red can", "basket"], 0.01)
    assert found
    assert {d.label for d in found} <= {"red can", "basket"}
    assert [d.score for d in found] == sorted((d.score for d in found), reverse=True)
    for d in found:
        assert 0 <= d.box.x_min <= d.box.x_max <= 100 and 0 <= d.box.y_min <= d.box.y_max <= 60
        assert 0.01 < d.score <= 1


def test_a_higher_threshold_keeps_the_better_boxes(kind, ctx):
    every = find(kind, ctx, ["red can", "basket"], 0.0)
    middle = every[len(every) // 2].score
    assert find(kind, ctx, ["red can", "basket"], middle) == [d for d in every if d.score > middle]


@pytest.mark.parametrize(
    ("kind", "stretch"),  # the second OWL pads to a square, the others do not
    [("grounding_dino", (100, 60)), ("owl1", (100, 60)), ("owl2", (100, 100))],
    indirect=["kind"],
)
def test_a_box_is_put_back_on_the_images_pixels(kind, ctx, stretch):
    basket = 4 if kind == "grounding_dino" else 1  # token of "[CLS] red can . basket .", or query
    with Answer(kind, (0.4, 0.3, 0.2, 0.1), basket):
        (found,) = find(kind, ctx, ["red can", "basket"], 0.5)
    width, height = stretch
    want = (0.3 * width, 0.25 * height, 0.5 * width, 0.35 * height)
    assert np.allclose([found.box.x_min, found.box.y_min, found.box.x_max, found.box.y_max], want, atol=1e-3)
    assert found.label == "basket"
    assert found.score == pytest.approx(1 / (1 + np.exp(-5.0)), abs=1e-3)


@pytest.mark.parametrize("kind", KINDS, indirect=True)
def test_the_librarys_own_reading_of_the_outputs_agrees(kind, ctx):
    """Same boxes and scores as transformers' post-processing of the same network."""
    net = loaded(kind)
    ours = find(kind, ctx, ["basket"], 0.02)
    text = "basket." if kind == "grounding_dino" else [["basket"]]
    inputs = net.processor(images=np.array(IMAGE.data), text=text, return_tensors="pt")
    extra = {"text_threshold": 0.0} if kind == "grounding_dino" else {}
    with net.running() as model:
        (theirs,) = net.processor.post_process_grounded_object_detection(
            model(**net.tensors(inputs)), threshold=0.02, target_sizes=[(60, 100)], **extra
        )
    got = sorted([d.score for d in ours])
    if kind != "grounding_dino":  # there the library also counts the full stop as a word
        assert got == pytest.approx(sorted(theirs["scores"].tolist()))
    for d in ours:
        corners = torch.tensor([d.box.x_min, d.box.y_min, d.box.x_max, d.box.y_max])
        cut = theirs["boxes"].cpu().float().clip(torch.zeros(4), torch.tensor([100.0, 60.0, 100.0, 60.0]))
        assert (cut - corners).abs().amax(dim=1).min() < 1e-2


def test_one_query_is_answered_as_among_others(serve, ctx):
    serve("owlvit", "owl", generation=2)
    net = loaded("owl2")

    def logits(queries):
        inputs = net.processor(images=np.array(IMAGE.data), text=[queries], return_tensors="pt")
        with net.running() as model:
            return model(**net.tensors(inputs)).logits[0].float().cpu()

    assert torch.allclose(logits(["can"])[:, 0], logits(["basket", "can", "tall box"])[:, 1], atol=1e-2)


def test_words_belong_to_their_phrase(serve):
    serve("grounding_dino")
    phrases = ["Red can", "the basket", "milk"]
    owner = assign_phrases(loaded("grounding_dino").processor.tokenizer, "red can. the basket. milk.", phrases)
    assert owner.tolist() == [-1, 0, 0, -1, 1, 1, -1, 2, -1, -1]


def test_a_word_below_the_text_threshold_names_nothing(serve, ctx):
    serve("grounding_dino")
    options = {"image": IMAGE, "text_prompt": "red can.", "box_threshold": 0.0}
    every = detect.grounding_dino_detect(ctx, **options, text_threshold=0.0).detections
    middle = every[len(every) // 2].score
    fewer = detect.grounding_dino_detect(ctx, **options, text_threshold=middle).detections
    assert fewer == [d for d in every if d.score > middle]


@pytest.mark.parametrize("phrases", [[], [" "], ["x"] * 65])
def test_prompts_without_phrases_or_with_too_many(ctx, phrases):
    wanted = [f"{p}{i}" if p.strip() else p for i, p in enumerate(phrases)]
    with pytest.raises(BadRequestError):
        find("grounding_dino", ctx, wanted, 0.2)
    with pytest.raises(BadRequestError):
        find("owl2", ctx, wanted, 0.2)


def test_prompts_longer_than_the_network_reads(kind, ctx):
    with pytest.raises(BadRequestError, match="are read"):
        find(kind, ctx, ["the tall red box " * 8], 0.2)


def test_thresholds_outside_0_to_1(ctx):
    with pytest.raises(BadRequestError, match="box_threshold is 2"):
        find("grounding_dino", ctx, ["can"], 2)


def test_boxes_come_as_contract_values(kind, ctx):
    found = find(kind, ctx, ["can"], 0.0)
    assert found and all(isinstance(d.box, BoundingBox2D) for d in found)
