import pytest

from gap_cli.sandbox import level
from gap_cli.sandbox.bench import sandbox_rows


@pytest.mark.skipif(level() == "none", reason="this kernel has no seccomp: nothing would run")
def test_every_row_was_measured_as_often_as_asked():
    rows = sandbox_rows(repeats=2, calls=5)
    assert [row.samples for row in rows] == [2, 2, 2, 5]
    assert all(0 < row.median <= row.p95 for row in rows)
    assert {row.unit for row in rows} == {"ms", "us"}
