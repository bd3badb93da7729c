"""perception-multi: three detectors, and when their opinions count."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gap_runtime.contracts.types import ObjectMask
from gap_runtime.errors import PerceptionError
from tests.unit.skills.eyes import AWAY, CAN, Eyes, camera, number, patch, seen
from tests.unit.skills.stage import LIBRARY, script

agree = script("perception-multi", "agree")
by_box, by_text, by_point = (script("perception-multi", n) for n in ("by_box", "by_text", "by_point"))
PROMPT = LIBRARY["perception-multi"].prompts["select_box"].read_text().strip()


class Cloudy(Eyes):
    """One camera; the slot of a mask says which cloud it is."""

    def lift(self, mask, **_):
        return super().lift(mask, None, None, None)


def join(*opinions, answer="none", cameras=1, clouds=(CAN, AWAY), **parameters):
    """Join opinions given as (detector, slot, score) or (detector, slot, score, camera)."""
    stage = Cloudy([([], list(clouds))] * cameras, answer)
    stage.calls.append(("", {"image": stage.cameras[0].rgb}))
    lists = {key: [] for d in ("box", "text", "point") for key in (f"{d}_masks", f"{d}_scores")}
    for detector, slot, score, *index in opinions:
        lists[f"{detector}_masks"].append(ObjectMask(detector, patch(slot), index[0] if index else 0))
        lists[f"{detector}_scores"].append(score)
    return agree(stage, stage.cameras, "can", PROMPT, **lists, **parameters), stage


def test_two_that_agree_outvote_a_third():
    found, stage = join(("box", 0, 0.4), ("text", 0, 0.5), ("point", 1, 0.9))
    assert found.cloud.points[:, 0].mean() == pytest.approx(0)
    assert found.score == 0.5
    assert stage.asked() == []


@pytest.mark.parametrize("answer", ["2", "box 2"])
def test_where_all_differ_the_model_decides(answer):
    found, stage = join(("box", 0, 0.9), ("text", 1, 0.5), answer=answer)
    assert found.cloud.points[:, 0].mean() == pytest.approx(0.3)
    assert stage.asked()[0].splitlines()[1:] == ["1: [0, 0, 5, 5]", "2: [5, 0, 10, 5]"]


def test_a_lone_opinion_must_be_confirmed():
    assert join(("point", 0, 0.9), answer="1")[0].score == 0.9
    with pytest.raises(PerceptionError, match="No two detectors agree on the can"):
        join(("point", 0, 0.9), answer="none")


def test_no_opinions_are_not_found():
    with pytest.raises(PerceptionError) as caught:
        join()
    assert caught.value.code == "not_found"


def test_masks_count_as_one_by_their_overlap():
    for iou, asked in ((0.5, 0), (0.99, 1)):
        stage = Cloudy([([], [CAN])], "1")
        stage.calls.append(("", {"image": stage.cameras[0].rgb}))
        pair = [ObjectMask("box", patch(0), 0)], [ObjectMask("text", patch(0, rows=4), 0)]
        agree(stage, stage.cameras, "can", PROMPT, pair[0], [0.9], pair[1], [0.8], [], [], same_iou=iou)
        assert len(stage.asked()) == asked


def test_cameras_that_agree_are_merged_and_the_most_voted_leads():
    both = [(d, 0, s, i) for i, s in enumerate((0.6, 0.5)) for d in ("box", "text")]
    found, _ = join(*both, ("point", 0, 0.1, 1), cameras=2)
    assert len(found.cloud.points) == len(CAN)
    assert found.score == 0.5


def test_each_detector_gives_its_best_mask_per_camera_and_nothing_where_it_sees_nothing():
    stage = Eyes(
        [(seen(0.7, 0.3), []), ([], [])],
        sam3__SegmentText=lambda image, text_prompt: SimpleNamespace(
            masks=[patch(1), patch(2)] if number(image) == 1 else [], scores=[0.8, 0.1], boxes=[]
        ),
        molmo__PointPrompt=lambda image, object_name: SimpleNamespace(pixel_x=3, pixel_y=1, found=number(image) == 0),
        sam3__SegmentPoint=lambda image, pixel_x, pixel_y: SimpleNamespace(masks=[patch(pixel_x // 5)], scores=[0.6]),
    )
    cameras = [camera(0), camera(1)]
    found = [run(stage, cameras, "can") for run in (by_box, by_text, by_point)]
    assert [[(m.name, m.camera_index) for m in f.masks] for f in found] == [[("box", 0)], [("text", 1)], [("point", 0)]]
    assert [f.scores for f in found] == [[0.7], [0.8], [0.6]]
