"""`gap skills new`: what it makes installs beside the engine, and a graph can use its skill and its tool."""

from __future__ import annotations

import json

import pytest

pytestmark = pytest.mark.slow


def test_a_new_skill_plugin_is_built_installed_and_run(cell, tmp_path):
    cell.run("gap", "skills", "new", "wave-hello", cwd=tmp_path)
    project = tmp_path / "wave-hello"
    cell.install(project)

    listed = json.loads(cell.run("gap", "skills", "list", "--json", cwd=tmp_path).stdout)
    assert "wave-hello" in {s["name"] for s in listed}
    tools = json.loads(cell.run("gap", "tools", "list", "--json", cwd=tmp_path).stdout)
    assert any(t["plugin"].startswith("gap_wave_hello") for t in tools)

    done = cell.run("python", "-m", "pytest", "-q", str(project), cwd=tmp_path)
    assert "passed" in done.stdout
