from gap_cli.bench.context import BenchRun
from gap_motion.bench.goals import GOALS, goals
from gap_motion.bench.motion import COLUMNS, motion
from tests.unit.motion.conftest import REGISTRY


def test_a_small_run_fills_every_column_and_finds_nothing_wrong():
    heard = []
    report = motion(BenchRun(REGISTRY, n=1, watch=lambda share, what: heard.append(share)))
    assert report.columns == COLUMNS and all(len(row) == len(COLUMNS) for row in report.rows)
    assert heard == sorted(heard) and heard[-1] <= 1.0
    result = {(row[0], row[1]): row[5] for row in report.rows}
    for robot in ("panda", "ur5e"):
        assert result[robot, "planned: in collision"] == 0
        assert result[robot, "executed: in collision"] == 0
    (met,) = report.more
    assert {(row[0], row[1]) for row in met.rows} == {(r, g.what) for r in ("panda", "ur5e") for g in GOALS}


def test_goals_are_met_or_not_by_the_numbers():
    rows = [
        ("arm", "retiming", 9, "5.00", "9.00", ""), ("arm", "IK, one pose", 9, "2.01", "", ""),
        ("arm", "collision check, bare", 9, "", "", "5.1 us a configuration"),
        ("arm", "grasps: solved", 9, "", "", "0.990"),
    ]  # fmt: skip
    assert [row[3:] for row in goals(rows).rows] == [("5", "yes"), ("2.01", "no"), ("5.1", "no"), ("0.99", "yes")]
