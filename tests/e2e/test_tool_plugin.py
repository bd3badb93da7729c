"""The recipe of CONTRIBUTING.md for a tool: what it shows is a plugin that installs and serves the tool."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
GUIDE = Path(__file__).parents[2] / "CONTRIBUTING.md"


def test_the_tool_of_the_guide_is_built_installed_and_shown(cell, tmp_path):
    recipe = re.search(r"^## Adding a tool$(.*?)^## ", GUIDE.read_text(), re.MULTILINE | re.DOTALL)[1]
    blocks = dict(reversed(re.findall(r"^```(python|toml|sh)\n(.*?)^```$", recipe, re.MULTILINE | re.DOTALL)))
    project = tmp_path / "gap-scale"
    project.mkdir()
    (project / "gap_scale.py").write_text(blocks["python"])
    (project / "pyproject.toml").write_text(blocks["toml"])
    install, show = blocks["sh"].splitlines()
    assert install == "pip install ./gap-scale"
    cell.install(project)  # as pip does, from what the tests have and not from the network
    shown = json.loads(cell.run(*show.split(), "--json", cwd=tmp_path).stdout)
    assert (shown["plugin"], shown["effect"]) == ("gap_scale", "sense")
    assert shown["inputs"]["arm_id"]["default"] == 0 and list(shown["fields"]) == ["weight"]
