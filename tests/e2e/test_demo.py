"""The demo at n=2, twice: what git sees of the second is what it saw of the first, whatever the day and the workers."""

from __future__ import annotations

import datetime
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.sim, pytest.mark.slow]
ROOT = Path(__file__).parents[2]


def demo(folder, workers):
    command = [sys.executable, "-m", "gap_cli.main", "demo", "-n", "2", "--workers", str(workers)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def git(folder, *arguments):
    command = ["git", "-c", "user.name=t", "-c", "user.email=t@localhost", *arguments]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_two_demos_do_not_differ_and_hold_what_they_promise(tmp_path):
    git(tmp_path, "init", "--quiet")
    shutil.copy(ROOT / ".gitignore", tmp_path)
    out = demo(tmp_path, workers=1)
    (run,) = (tmp_path / "runs").iterdir()
    for path in ("report.html", "rehearse/00/feedback.md", "generate/workflow.json"):
        assert str(Path("runs") / run.name / path) in out
        assert (run / path).stat().st_size > 0
    git(tmp_path, "add", "--all")
    git(tmp_path, "commit", "--quiet", "--message", "first")
    seen = git(tmp_path, "ls-files").split()
    assert f"runs/{run.name}/rehearse/00/episodes.jsonl" in seen
    assert not [
        name for name in seen if name.endswith((".png", ".mcap", ".log", "meta.json", "timings.jsonl", ".html"))
    ]
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    assert not [name for name in seen if today in (tmp_path / name).read_text()]

    shutil.rmtree(run)
    demo(tmp_path, workers=2)
    assert git(tmp_path, "status", "--porcelain") == ""

    summary = json.loads((run / "rehearse/00/summary.json").read_text())
    assert summary["episodes"] == 2 and not summary["partial"] and not summary["void"]
    stages = [s["stage"] for s in summary["subgraphs"]]
    assert stages[:4] == ["perceive", "perceive", "grasp", "place"]  # then the ways where one of them fails
    assert summary["privileged_tools"] == []
