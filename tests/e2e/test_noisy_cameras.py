"""A rehearsal through noisy cameras: the same episodes for any number of workers."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = [pytest.mark.sim, pytest.mark.slow]


def gap(folder, *arguments):
    command = [sys.executable, "-m", "gap_cli.main", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr


def test_noise_does_not_depend_on_the_number_of_workers(tmp_path):
    say = "Pick the cream cheese and place it in the basket"
    gap(tmp_path, "plan", "--task", "fulfill-grocery", "--variant", "xy20-realistic", "--say", say)
    gap(tmp_path, "generate")
    gap(tmp_path, "validate")
    found = []
    for workers in ("1", "2"):
        gap(tmp_path, "rehearse", "-n", "2", "--workers", workers, "--record", "none")
        (episodes,) = tmp_path.glob("runs/*/rehearse/*/episodes.jsonl")
        found.append(episodes.read_bytes())
        episodes.unlink()
    assert found[0] == found[1] and found[0].count(b"\n") == 2
