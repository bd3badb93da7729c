"""perception-subpart: the part is looked for in the parent's crop, and its mask put back into the whole image."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from gap_runtime.contracts.types import Mask, PointCloud
from gap_runtime.errors import PerceptionError
from tests.unit.skills.eyes import AWAY, CAN, COLUMNS, ROWS, Eyes, seen
from tests.unit.skills.stage import script

run = script("perception-subpart", "perceive_part")


def perceive(views, parts, clouds=(CAN,), **parameters):
    """`parts[i]`: the score of the part in camera i, None where the segmenter finds nothing."""
    crops = []
    masks = []

    def segment(image, text_prompt):
        crops.append(image.data.shape[:2])
        score = parts[int(image.data[0, 0, 0])]
        data = np.zeros(image.data.shape[:2], bool)
        data[0, 0] = True
        return SimpleNamespace(masks=[] if score is None else [Mask(data)], scores=[score], boxes=[])

    def lift(mask, **_):
        masks.append(mask)
        return PointCloud(clouds[min(len(masks), len(clouds)) - 1])

    stage = Eyes(views, sam3__SegmentText=segment)
    stage.answers["geometry_svc.MaskToWorldPoints"] = lift
    return run(stage, stage.cameras, "pan", "handle", **parameters), crops, masks


def test_the_part_is_looked_for_inside_the_parent():
    found, crops, masks = perceive([(seen(0.1, 0.2)[1:], [])], [0.7], margin=0.0)
    assert crops == [(5, 5)]
    assert masks[0].data.shape == (ROWS, COLUMNS)
    assert list(zip(*np.nonzero(masks[0].data), strict=True)) == [(0, 5)]
    assert found.score == 0.7


@pytest.mark.parametrize(("margin", "size"), [(0.2, (6, 7)), (10.0, (ROWS, COLUMNS))])
def test_the_crop_is_widened_and_stays_in_the_image(margin, size):
    _, crops, _ = perceive([(seen(0.1, 0.2)[1:], [])], [0.7], margin=margin)
    assert crops == [size]


def test_cameras_that_agree_are_merged_under_the_surest():
    found, _, masks = perceive([(seen(0.9), []), (seen(0.9), [])], [0.3, 0.8], clouds=(CAN[:50], CAN[50:]))
    assert len(found.cloud.points) == len(CAN)
    assert found.mask is masks[1]


def test_another_part_elsewhere_is_not_merged():
    found, _, _ = perceive([(seen(0.9), []), (seen(0.9), [])], [0.3, 0.8], clouds=(CAN, AWAY))
    assert found.cloud.points[:, 0].min() > 0.2


@pytest.mark.parametrize(
    ("views", "parts", "clouds", "code"),
    [
        ([([], [])], [0.9], (CAN,), "no_parent"),
        ([(seen(0.9), [])], [None], (CAN,), "not_found"),
        ([(seen(0.9), [])], [0.05], (CAN,), "not_found"),
        ([(seen(0.9), [])], [0.9], (CAN[:10],), "not_found"),
    ],
)
def test_what_is_not_there_is_not_found(views, parts, clouds, code):
    with pytest.raises(PerceptionError, match="pan") as caught:
        perceive(views, parts, clouds)
    assert caught.value.code == code
