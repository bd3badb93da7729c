"""The grasp benchmark's own parts: what it grasps, what it sees, how it counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gap_cli.contracts.task import load_task
from gap_grasps.bench import calibration, rates
from gap_grasps.bench_objects import REGION, bench_task, place, subjects
from gap_grasps.bench_run import report
from gap_grasps.bench_sight import handle_of

TASK = bench_task(load_task(Path(__file__).parents[2] / "tasks" / "fulfill-grocery"))


def test_every_object_is_alone_in_its_scene():
    assert all(list(TASK.scene_objects(name)) == [name] for name in TASK.objects)
    assert {"frypan", "mug", "box", "milk"} <= set(TASK.objects) and "basket" not in TASK.objects
    assert [s.model for s in subjects(TASK) if s.handle_only] == ["frypan"]


@pytest.mark.parametrize("name", ["milk", "frypan", "alphabet_soup"])
def test_objects_stand_or_lie_on_the_floor_within_the_region(name):
    half = np.array(TASK.objects[name].shape.size) / 2
    heights = set()
    for seed in range(20):
        pose = place(TASK, name, seed).poses[name]
        low, high = np.array(REGION)
        assert (pose.position.array[:2] >= low).all() and (pose.position.array[:2] <= high).all()
        heights.add(round(pose.position.z, 6))
        assert np.abs(pose.rotation.rotation.as_matrix()[2]) @ half == pytest.approx(pose.position.z)
    assert (len(heights) > 1) == (TASK.objects[name].shape.kind == "box")


def test_the_same_seed_is_the_same_place():
    assert place(TASK, "milk", 3).poses == place(TASK, "milk", 3).poses != place(TASK, "milk", 4).poses


def test_a_handle_is_the_thin_part_even_of_a_hollow_thing():
    angle = np.linspace(0, 2 * np.pi, 400)
    rim = np.column_stack([0.1 * np.cos(angle), 0.1 * np.sin(angle)])
    x, y = (g.ravel() for g in np.meshgrid(np.arange(0.1, 0.25, 0.002), np.arange(-0.012, 0.012, 0.002)))
    points = np.insert(np.concatenate([rim, np.column_stack([x, y])]), 2, 0.05, axis=1)
    part = handle_of(points)
    assert part[len(rim) :].mean() > 0.9 and part[: len(rim)].mean() < 0.1


def row(name, success, score=0.5, generator="graspgen"):
    return {"object": name, "generator": generator, "success": success, "score": score, "ms": 1.0}


def test_rates_carry_their_count_and_interval():
    (rate,) = rates([row("milk", True), row("milk", False)], "object")
    assert (rate["n"], rate["success"]) == (2, 0.5) and rate["low"] < 0.5 < rate["high"]


def test_calibration_is_by_score_and_leaves_out_what_was_never_tried():
    rows = [row("milk", False, 0.1), row("milk", True, 0.9), row("milk", True, 1.0), row("milk", False, None)]
    assert [(b["score_bin"], b["n"], b["success"]) for b in calibration(rows)] == [
        ("0.0-0.2", 1, 0.0),
        ("0.8-1.0", 2, 1.0),
    ]


def test_the_report_sums_groceries_and_shows_the_rest():
    found = report([row("milk", True), row("butter", False), row("mug", False)], [row("milk", True)])
    cells = {r[0]: r[1] for r in found.rows}
    assert cells["all groceries"].startswith("0.500") and cells["mug"].startswith("0.000")
    assert any("score 0.4-0.6" in r[0] for r in found.rows)
