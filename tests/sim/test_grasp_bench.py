"""One scene of the grasp benchmark in physics: seen once, tried twice, the same each time."""

from __future__ import annotations

import numpy as np
import pytest

from gap_cli.bench.context import BenchRun
from gap_grasps.bench.grasps import DRAWN
from gap_grasps.bench.objects import LIES
from gap_grasps.bench.run import GraspJob, job_rows
from gap_runtime.plugins import load_registry

pytestmark = pytest.mark.sim
SEED = 1  # a development seed, lying


def plain(row):
    return {k: np.asarray(v).tolist() for k, v in row.items() if k != "ms"}


def test_a_lying_can_is_taken_and_a_seed_is_one_story():
    bench, job = BenchRun(load_registry()), GraspJob("alphabet_soup", range(SEED, SEED + 1), ("graspgen",), 1)
    best, drawn = job_rows(bench, job)
    assert best["success"] and best["rest"] == LIES and best["rank"] is not None
    assert drawn["generator"] == DRAWN and 0 < drawn["score"] <= 1 and drawn["pose"].shape == (4, 4)
    assert [plain(best), plain(drawn)] == [plain(row) for row in job_rows(bench, job)]
