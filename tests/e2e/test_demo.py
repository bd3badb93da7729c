"""From a sentence to a rehearsed graph in the real cell, twice: what git would see is the same, byte for byte."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = [pytest.mark.sim, pytest.mark.slow, pytest.mark.xdist_group("demo")]


def gap(*arguments, cwd):
    env = os.environ | {"NO_COLOR": "1", "COLUMNS": "200"}
    command = [sys.executable, "-m", "gap_cli.main", *arguments]
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, timeout=400, check=True)


def visible(folder):
    """Name and bytes of every file git would keep, by the repository's own .gitignore."""
    subprocess.run(["git", "init", "-q"], cwd=folder, check=True)
    (folder / ".gitignore").write_bytes((ROOT / ".gitignore").read_bytes())
    list_files = ["git", "ls-files", "--others", "--exclude-standard", "runs"]
    listed = subprocess.run(list_files, cwd=folder, capture_output=True, text=True, check=True)
    return {name: (folder / name).read_bytes() for name in listed.stdout.splitlines()}


@pytest.fixture(scope="module")
def demos(tmp_path_factory):
    """The demo at two instances, with one worker and with two."""
    folders = []
    for workers in (1, 2):
        folder = tmp_path_factory.mktemp(f"demo{workers}")
        gap("demo", "-n", "2", "--workers", str(workers), cwd=folder)
        folders.append(folder)
    return folders


def test_the_demo_leaves_a_whole_run(demos):
    (run,) = (demos[0] / "runs").iterdir()
    summary = json.loads((run / "rehearse" / "00" / "summary.json").read_text())
    assert (summary["success"]["passed"], summary["success"]["of"]) == (2, 2)
    for name in ("run.yaml", "lock.json", "plan/plan.json", "generate/workflow.json", "validate/findings.json"):
        assert (run / name).stat().st_size > 0, name
    assert (run / "report.html").stat().st_size > 10_000


def test_workers_and_repetition_change_no_byte(demos):
    one, two = (visible(folder) for folder in demos)
    assert one.keys() == two.keys() and len(one) > 10
    assert [name for name in one if one[name] != two[name]] == []
