"""perception-any: one question decides, none is a clean answer, other cameras add what touches."""

from __future__ import annotations

import numpy as np
import pytest

from gap_runtime.errors import PerceptionError
from tests.unit.skills.eyes import AWAY, CAN, Eyes, seen
from tests.unit.skills.stage import LIBRARY, script

run = script("perception-any", "pick_mark")
PROMPT = LIBRARY["perception-any"].prompts["pick_mark"].read_text().strip()


def pick(views, answer, **parameters):
    stage = Eyes(views, answer)
    return run(stage, stage.cameras, "can", PROMPT, **parameters), stage


def test_even_a_lone_detection_is_put_to_the_model():
    found, stage = pick([(seen(0.4), [CAN])], "1")
    assert len(found.cloud.points) == len(CAN)
    assert stage.asked() == ["Which numbered box shows the can? Answer with one number or none.\n1: [0, 0, 5, 5]"]


def test_the_model_picks_by_number():
    found, _ = pick([(seen(0.9, 0.2), [CAN, AWAY])], "box 2")
    assert found.cloud.points[:, 0].mean() == pytest.approx(0.3)
    assert found.score == 0.2


@pytest.mark.parametrize("answer", ["none", "None of them.", "3", "cannot answer: 2 look alike", ""])
def test_none_and_nonsense_are_not_found(answer):
    with pytest.raises(PerceptionError, match="No camera shows any can") as caught:
        pick([(seen(0.9, 0.8), [CAN, CAN])], answer)
    assert caught.value.code == "not_found"


def test_nothing_detected_is_not_found_without_a_question():
    stage = Eyes([([], []), ([], [])], "1")
    with pytest.raises(PerceptionError):
        run(stage, stage.cameras, "can", PROMPT)
    assert stage.asked() == []


def test_the_first_camera_with_an_answer_decides_and_others_add_what_touches():
    left, right = CAN[CAN[:, 0] <= 0], CAN[CAN[:, 0] > 0]
    found, stage = pick([([], []), (seen(0.5), [left]), (seen(0.9, 0.8), [AWAY, right])], "1")
    assert len(found.cloud.points) == len(CAN)
    assert len(stage.asked()) == 1


def test_no_more_marks_are_offered_than_allowed():
    _, stage = pick([(seen(0.9, 0.8, 0.7), [CAN] * 3)], "1", max_marks=2)
    assert stage.asked()[0].count("\n") == 2


def test_too_few_points_are_no_object():
    with pytest.raises(PerceptionError):
        pick([(seen(0.9), [CAN[:10]])], "1")


def test_one_point_is_kept_per_cell():
    found, _ = pick([(seen(0.9), [np.concatenate([CAN] * 3)])], "1")
    assert len(found.cloud.points) == len(CAN)
