"""Numbers of the perception benchmark: what counts as what, and goals beside what was reached."""

from __future__ import annotations

import math

import pytest

from gap_perception.bench.report import GOALS, report
from gap_perception.bench.summary import by, summarise
from gap_runtime.contracts.task.sensors import CameraNoise, StereoDepth


def row(name, there=True, found=True, *, sensor="clean", wrong=False, mm=1.0, clutter="usual", seed=1):
    right = {"iou": 0.9, "center_mm": mm, "yaw_deg": None} if found and not wrong else {}
    base = {"seed": seed, "clutter": clutter, "sensor": sensor, "object": name, "present": there, "ms": None}
    return base | {"found": found, "wrong": wrong, "pixels": 500 if there else 0} | right


ROWS = [row("a"), row("b", found=False), row("c", False, False), row("d", False, wrong=True)]


def test_found_missed_and_mistaken_are_counted():
    numbers = summarise(ROWS)
    assert (numbers["precision"], numbers["recall"], numbers["wrong_rate"]) == (0.5, 0.5, 0.25)
    assert (numbers["scenes"], numbers["searches"]) == (1, 4)
    assert math.isnan(numbers["yaw_deg_median"]) and math.isnan(numbers["ms_p95"])
    assert summarise([]) == {}


def test_what_cannot_be_seen_is_not_missed():
    hidden = row("a", found=False) | {"pixels": 99}
    assert summarise([row("b"), hidden])["recall"] == 1


def test_groups_are_summed_up_apart():
    groups = by([*ROWS, row("a", sensor="realistic", found=False)], "sensor", "object")
    assert groups["clean", "a"]["recall"] == 1 and groups["realistic", "a"]["recall"] == 0


@pytest.mark.parametrize(("mm", "met"), [(10.0, "yes"), (10.1, "no")])
def test_goals_stand_beside_what_was_reached(mm, met):
    table = report([row("a", mm=mm)], {}, (), 0)
    goals = {(sensor, measure): rest for sensor, measure, *rest in table.rows}
    assert goals["clean", "centre p95 [mm]"] == [10.0, mm, met]
    assert {sensor for sensor, _ in goals} == {"clean"}
    both = report([row("a"), row("a", sensor="realistic", wrong=True)], {}, (), 0)
    assert len(both.rows) == len(GOALS)
    assert next(r for r in both.rows if r[0] == "realistic")[2:] == (0.02, 1.0, "no")


def test_tables_keep_their_order_and_are_rectangular():
    rows = [row(o, sensor=s, clutter=c) for s in ("clean", "bad") for c in ("dense", "sparse") for o in ("b_b", "a")]
    _, clutter, objects = report(rows, {}, (), 0).more
    assert [line[:2] for line in clutter.rows] == [
        ("clean", "sparse"), ("clean", "dense"), ("bad", "sparse"), ("bad", "dense"),
    ]  # fmt: skip
    assert [line[1] for line in objects.rows] == ["a", "b b"] * 2
    for table in (clutter, objects):
        assert {len(line) for line in table.rows} == {len(table.columns)}


def test_what_was_not_measured_is_blank():
    (line,) = report([row("a", found=False)], {}, (), 0).more[0].rows
    assert line.count("") == 7


def test_noise_is_described_in_numbers():
    depth = StereoDepth(baseline=0.05, focal=400, subpixel=0.1, dropout=0.01)
    notes = report(ROWS, {"real": CameraNoise(depth=depth, colour=3, shift=0.002)}, (), 7).notes
    assert "Seeds from 7 on." in notes
    assert any(n.startswith("Sensor real: depth noise 5 mm at 1 m") and "off by 2 mm" in n for n in notes)
