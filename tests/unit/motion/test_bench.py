from gap_motion.bench import COLUMNS, motion


def test_a_small_run_fills_every_column_and_finds_nothing_wrong():
    heard = []
    report = motion(lambda share, what: heard.append(share), problems=2, judged=5, executed=1)
    assert report.columns == COLUMNS and all(len(row) == len(COLUMNS) for row in report.rows)
    assert heard == sorted(heard) and heard[-1] <= 1.0
    result = {(row[0], row[1]): row[5] for row in report.rows}
    for robot in ("panda", "ur5e"):
        assert result[robot, "planned: in collision"] == 0
        assert result[robot, "executed: in collision"] == 0
