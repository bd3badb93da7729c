"""Checkpoints as files, and the expressions they hold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gap_runtime.contracts.predicates import check_expression
from gap_runtime.contracts.snapshot import BodyState, WorldSnapshot
from gap_runtime.contracts.types import OrientedBoundingBox, Quaternion, Se3Pose, Vec3
from gap_runtime.errors import DocumentError, UnknownNameError
from gap_runtime.graph.checkpoints import Checkpoint, evaluate, parse_checkpoints, render_checkpoints

UPRIGHT = Quaternion(1.0, 0.0, 0.0, 0.0)


def body(name, x, z, contacts=(), cavity=None):
    place = Vec3(x, 0.0, z)
    box = OrientedBoundingBox(place, Vec3(0.03, 0.03, 0.05), UPRIGHT)
    return BodyState(name, Se3Pose(place, UPRIGHT), box, 0.0, 0.0, frozenset(contacts), cavity)


FINGERS = ("robot:0:left_finger", "robot:0:right_finger")
BASKET = body("basket", 0.5, 0.05, cavity=OrientedBoundingBox(Vec3(0.5, 0.0, 0.05), Vec3(0.1, 0.1, 0.1), UPRIGHT))
START = WorldSnapshot(0.0, {"soup": body("soup", 0.1, 0.05), "basket": BASKET}, {}, ())
NOW = WorldSnapshot(
    3.0,
    {"soup": body("soup", 0.2, 0.25, FINGERS), "basket": BASKET},
    {"knob": 0.7},
    (),
    {"soup": "alphabet soup"},
    START,
)


@pytest.mark.parametrize(("text", "value"), [
    ('w.body("soup").is_grasped()', True), ('w.body("alphabet soup").z', 0.25), ('w.joint("knob") > 0.5', True),
    ('w.body("soup").lifted() > 0.1 and not w.body("soup").is_released()', True), ("w.time", 3.0),
    ('w.body("soup").is_in(w.body("basket"))', False), ('0.1 < w.body("soup").z < 0.3', True),
    ('abs(w.body("soup").x - w.body("basket").x)', 0.3), ('w.body("soup").size.z', 0.1), ("-w.time + 4", 1.0),
    ('1 if w.body("soup").touches("robot") else 2', 1), ('max(w.time, 5) / 2', 2.5), ("hypot(3, 4)", 5.0),
])  # fmt: skip
def test_an_expression_has_its_value(text, value):
    assert check_expression(text).problems == ()
    assert evaluate(text, NOW) == pytest.approx(value)


@pytest.mark.parametrize(("text", "says"), [
    ("", "not an expression"), ("w.body(", "not an expression"), ("x > 1", "'x' is not known"),
    ("__import__('os')", "not known"), ("w.__class__", "no '__class__'"), ("w.body('a').is_graped()", "is_graped"),
    ("w.body('a')._world", "_world"), ("[w for w in ()]", "not allowed"), ("lambda: 1", "not allowed"),
    ("w.body('a').lifted", "question"), ("w.body('a').x()", "not called"), ("w.body('a').is_in('b')", "wants a body"),
    ("w.body('a').distance_to()", "takes 1"), ("w.body(name='a').x", "by position"), ("2 ** 9 ** 9", "not allowed"),
    ("w.body('a') + 1", "is a body"), ("w.body(w.time).x", "wants a text"), ("abs(1, 2)", "takes 1"),
    ("w.time.real", "no 'real'"), ("f'{w}'", "not allowed"), ("(w := 1)", "not allowed"),
    ("w.time and " * 150 + "True", "more than"), ("1" * 3000, "longer"), ("not " * 190 + "w.time > 1", "more than"),
    ("(" * 500 + "1" + ")" * 500, "nested"), ("w.time if w.time else 'x'", "not a truth"),
])  # fmt: skip
def test_what_is_not_one_is_refused_and_never_run(text, says):
    assert any(says in p.message for p in check_expression(text).problems)
    with pytest.raises(DocumentError):
        evaluate(text, NOW)


@pytest.mark.parametrize("text", ["w.body('a').mask_iou() > 0.5", "detection_score > 1", "w.body('a').cloud.size"])
def test_what_the_cameras_saw_is_marked(text):
    assert any(p.camera for p in check_expression(text).problems)


@pytest.mark.parametrize("text", ["1 / (w.time - 3)", "sqrt(-1)", "'a' < 1", "w.body('soup').z > 'x'"])
def test_an_expression_without_a_value_says_so(text):
    with pytest.raises(DocumentError):
        evaluate(text, NOW)


def test_an_unknown_body_is_named():
    with pytest.raises(UnknownNameError, match="soup"):
        evaluate('w.body("sopu").z', NOW)


@settings(max_examples=200, deadline=None)
@given(st.text(alphabet="w.body('soup)zx <>=+-*/andort0123[]{}:,_\"", max_size=40))
def test_no_text_breaks_the_checker(text):
    checked = check_expression(text)
    if not checked.problems and checked.kind in ("truth", "number"):
        try:
            value = evaluate(text, NOW)
        except (DocumentError, UnknownNameError):
            return
        assert isinstance(value, (bool, int, float, np.bool_, str))


POINTS = (
    Checkpoint("held", 'w.body("soup").is_grasped()', 'Both "fingers" touch it.\n', True, 1.0, {"z": "w.time"}),
    Checkpoint("probe", "w.time > 1", validate=False, weight=0.5),
)


def test_a_file_is_read_back_as_it_was_written():
    assert parse_checkpoints(render_checkpoints(POINTS), "checkpoints/sg.py") == POINTS
    assert tuple(Checkpoint.of(p.as_dict(), "x") for p in POINTS) == POINTS
    assert parse_checkpoints(render_checkpoints([]), "x") == ()


@pytest.mark.parametrize("source", [
    "", "CHECKPOINTS = 3", "CHECKPOINTS = [1]", "CHECKPOINTS = [Checkpoint()]", "CHECKPOINTS = [Checkpoint('a')]",
    "CHECKPOINTS = [Checkpoint('a', print)]", "CHECKPOINTS = [Checkpoint('a', 'w.time', colour='red')]",
    "CHECKPOINTS = [Checkpoint('a', 'w.time', **{})]", "CHECKPOINTS = [Checkpoint(*['a', 'b'])]",
    "CHECKPOINTS = [Checkpoint('a', 'w.time', weight=-1)]", "CHECKPOINTS = [Checkpoint('a', 'w.time', weight=1e999)]",
    "CHECKPOINTS = [Checkpoint('a', 'w.time', validate='no')]", "CHECKPOINTS = [Checkpoint('a', '1', '', name='b')]",
    "CHECKPOINTS = [Checkpoint('a', '1'), Checkpoint('a', '2')]", "import os\nos.system('true')\nCHECKPOINTS = []",
    "CHECKPOINTS = [os.Checkpoint('a', '1')]", "CHECKPOINTS = [", "\x00", "CHECKPOINTS = [" + "(" * 3000,
    "CHECKPOINTS = [Checkpoint('a', '1', diagnostics=[1])]", "CHECKPOINTS = [Checkpoint('a', '1', diagnostics={1: 2})]",
])  # fmt: skip
def test_a_file_that_is_more_or_less_than_checkpoints_is_refused(source):
    with pytest.raises(DocumentError):
        parse_checkpoints(source, "checkpoints/sg.py")
