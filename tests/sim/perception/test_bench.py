"""The perception benchmark on one scene: every object is looked for once, and judged by what is truly in view."""

from __future__ import annotations

import pytest

from gap_cli.bench.context import BenchRun
from gap_perception.bench import run as bench_run
from gap_perception.bench.perception import CLEAN, level_task, levels_of, measure
from gap_perception.bench.pictures import TILE, worst
from gap_perception.bench.run import ScenesJob, measure_job, skill_way
from gap_perception.bench.scenes import LEVELS
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
BENCH = BenchRun(load_registry())
WAY = skill_way(BENCH.skill(bench_run.SKILL))
SEED = 1  # seven objects in view, a development seed


@pytest.fixture(scope="module")
def searches(cell):
    return list(measure(cell, WAY, [SEED]))


@pytest.fixture
def forget():
    yield
    bench_run._cells.pop("realistic").cell.close()


def test_every_object_is_looked_for_once_and_found_where_it_is(cell, searches):
    rows = {search.row["object"]: search.row for search in searches}
    assert len(searches) == len(rows) == len(cell.task.objects)
    assert sum(row["ms"] is not None for row in rows.values()) == 1
    assert sum(row["present"] for row in rows.values()) == LEVELS[SEED % len(LEVELS)].objects + 1
    for name, row in rows.items():
        assert row["found"] == row["present"] and not row["wrong"], name
        assert not row["present"] or (row["iou"] > 0.8 and row["center_mm"] < 10), name


def test_the_same_scene_gives_the_same_rows_and_pictures(cell, searches):
    def told(found):
        rows, cases = worst(found)
        return [row | {"ms": None} for row in rows], [(c.order, c.lines, c.picture.tobytes()) for c in cases]

    first = told(searches)
    assert first == told(measure(cell, WAY, [SEED]))
    assert len(first[1]) == sum(row["present"] for row in first[0])


def test_levels_are_the_tasks_own_and_the_first_is_perfect(cell):
    levels = levels_of(cell.task)
    assert levels == (CLEAN, *cell.task.sensors.models) and len(levels) >= 4
    assert level_task(cell.task, CLEAN).sensors.use == {}
    assert level_task(cell.task, "realistic").sensors.use == "realistic"


@pytest.mark.usefixtures("forget")
def test_groceries_are_told_apart_through_realistic_cameras():
    rows, cases = measure_job(BENCH, ScenesJob("realistic", SEED, 1))
    assert all(row["found"] == row["present"] and not row["wrong"] for row in rows)
    centre = [row["center_mm"] for row in rows if row["present"]]
    assert 0.5 < max(centre) < 20  # noise was there
    assert all(case.picture.shape == (TILE[1], TILE[0], 3) for case in cases)
