"""The wheel alone, installed in an empty environment outside the checkout, runs the demo."""

from __future__ import annotations

import json

import pytest

pytestmark = [pytest.mark.sim, pytest.mark.slow]


def test_the_wheel_carries_everything_the_demo_needs(cell, tmp_path):
    work = tmp_path / "elsewhere"
    work.mkdir()
    where = "import gap_cli, gap_mujoco, morsl; print(gap_cli.__file__, gap_mujoco.__file__, morsl.__file__)"
    for file in cell.run("python", "-c", where, cwd=work).stdout.split():
        assert file.startswith(str(cell.home)), file
    cell.run("gap", "demo", "-n", "1", cwd=work)
    (run,) = (work / "runs").iterdir()
    summary = json.loads((run / "rehearse" / "00" / "summary.json").read_text())
    assert summary["episodes"] == 1
    assert (run / "report.html").stat().st_size > 10_000
