"""The grasp benchmark's own parts: what it grasps, what it sees, how it counts."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gap_grasps.bench.execution import VOID, execute, was_tried
from gap_grasps.bench.grasps import DRAWN
from gap_grasps.bench.objects import LIES, REGION, STANDS, bench_task, place, rest, subjects
from gap_grasps.bench.perception import handle_of
from gap_grasps.bench.report import report
from gap_grasps.bench.run import CHUNK, jobs
from gap_grasps.bench.sampling import drawn_evenly
from gap_grasps.bench.sheet import COLUMNS, TILE, sheet, worst
from gap_robots.panda import panda
from gap_runtime.contracts.failures import SimulationDivergedError
from gap_runtime.contracts.task import load_task
from gap_runtime.contracts.types import Quaternion, Se3Pose, Vec3

PLAIN = load_task(Path(__file__).parents[2] / "tasks" / "fulfill-grocery")
TASK = bench_task(PLAIN)


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
    assert (len(heights) > 1) == (TASK.objects[name].shape.kind in ("box", "cylinder"))


def test_what_can_lie_does_so_half_of_the_time():
    assert [rest(TASK, "alphabet_soup", seed) for seed in range(4)] == [STANDS, LIES, STANDS, LIES]
    assert rest(TASK, "mug", 1) == STANDS
    lying = place(TASK, "alphabet_soup", 1).poses["alphabet_soup"].rotation.rotation.as_matrix()
    assert abs(lying[2, 2]) < 1e-9, "its axis is level"


def test_the_same_seed_is_the_same_place():
    assert place(TASK, "milk", 3).poses == place(TASK, "milk", 3).poses != place(TASK, "milk", 4).poses


def test_a_handle_is_the_thin_part_even_of_a_hollow_thing():
    angle = np.linspace(0, 2 * np.pi, 400)
    rim = np.column_stack([0.1 * np.cos(angle), 0.1 * np.sin(angle)])
    x, y = (g.ravel() for g in np.meshgrid(np.arange(0.1, 0.25, 0.002), np.arange(-0.012, 0.012, 0.002)))
    points = np.insert(np.concatenate([rim, np.column_stack([x, y])]), 2, 0.05, axis=1)
    part = handle_of(points)
    assert part[len(rim) :].mean() > 0.9 and part[: len(rim)].mean() < 0.1


def row(name, success, score=0.5, generator="graspgen", **more):
    about = {"object": name, "generator": generator, "success": success, "score": score, "ms": 1.0}
    return {**about, "seed": 0, "rest": STANDS, "reason": "", **more}


def test_the_report_sums_groceries_and_holds_them_against_the_goal():
    found = report([row("milk", True), row("butter", True), row("milk", False, generator="box"), row("mug", False)], 0)
    cells = {r[0]: r for r in found.rows}
    assert cells["groceries"][1].startswith("1.000") and cells["groceries"][1].endswith("(2)")
    assert cells["groceries"][-1] == ">= 0.97: met by graspgen; missed by box"
    assert cells["mug"][1].startswith("0.000") and cells["milk"][4].startswith("0.000")


def test_the_report_counts_by_score_what_came_to_the_grasp():
    drawn = [row("milk", i >= 5, 0.05 + 0.1 * i, DRAWN, seed=i) for i in range(10)]
    found = report([*drawn, row("milk", False, 0.95, DRAWN, reason="way: contact")], 0)
    (table,) = found.more
    by_score = {r[0]: r for r in table.rows}
    assert by_score["0.9-1.0"][1] == 1 and by_score["0.9-1.0"][4].endswith("yes")
    assert by_score["area under the ROC curve"][3].startswith("1.000")
    assert any("1 of 11" in note for note in found.notes)


def test_only_what_came_to_the_grasp_was_tried():
    assert was_tried(row("milk", False, reason="approach: contact"))
    assert not was_tried(row("milk", False, reason="way: contact"))
    assert not was_tried(row("milk", False, reason="approach: unreachable"))
    assert not was_tried(row("milk", False, score=None, reason="no_grasp"))
    assert not was_tried(row("milk", False, reason=VOID))


def test_physics_that_diverges_ends_the_try_and_not_the_benchmark():
    def blow_up(name, **inputs):
        if name == "gripper.Close":
            raise SimulationDivergedError("Something moves at 165 m/s.")

    cell = SimpleNamespace(tool=blow_up, cell=SimpleNamespace(wait=lambda seconds: None))
    assert execute(cell, Se3Pose(Vec3(0.0, 0.0, 0.1), Quaternion(0.0, 1.0, 0.0, 0.0))) == VOID


def test_grasps_are_drawn_over_the_whole_range_and_none_twice():
    ranked = [(i, 0.9) for i in range(90)] + [(90 + i, 0.1 * i) for i in range(10)]
    drawn = drawn_evenly(ranked, 40, np.random.default_rng(0), lambda pose: pose)
    assert len({pose for pose, _ in drawn}) == len(drawn) == 40
    assert sum(score < 0.85 for _, score in drawn) >= 8, "a tenth of the pool, but most of the range"
    assert drawn_evenly(ranked, 3, np.random.default_rng(0), lambda pose: None) == []
    assert drawn_evenly([], 3, np.random.default_rng(0), lambda pose: pose) == []


def test_jobs_share_out_every_object_and_seed_once():
    work = jobs(SimpleNamespace(task=lambda name: PLAIN), range(100, 100 + 2 * CHUNK + 1), ("box",), 0)
    assert sorted((name, seed) for name, seeds, *_ in work for seed in seeds) == sorted(
        (s.name, seed) for s in subjects(TASK) for seed in range(100, 100 + 2 * CHUNK + 1)
    )


def test_the_picture_shows_the_grasp_that_disappoints_most():
    import cv2

    cloud = np.random.default_rng(0).uniform(-0.03, 0.03, (50, 3))
    shown = [
        row(name, won, score, DRAWN, cloud=cloud, pose=np.eye(4))
        for name, won, score in [("milk", True, 0.99), ("milk", False, 0.3), ("milk", False, 0.8), ("mug", True, 0.7)]
    ]
    chosen = worst([*shown, row("butter", True)])
    assert [(r["object"], r["score"]) for r in chosen] == [("milk", 0.8), ("mug", 0.7)]
    picture = sheet(chosen, panda().gripper)
    image = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
    assert picture.suffix == ".png" and image.shape == (TILE, COLUMNS * TILE, 3)
    tiles = [image[:, :TILE].astype(int), image[:, TILE : 2 * TILE].astype(int)]
    reddest = [int((t[..., 2] - t[..., 1]).max()) for t in tiles]
    assert reddest[0] > 100 > reddest[1], "failed is red"
