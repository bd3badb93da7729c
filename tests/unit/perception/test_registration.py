import json
import subprocess
import sys
from pathlib import Path

import pytest

from gap_runtime.plugins import load_registry

CATALOGUE = json.loads((Path(__file__).parents[2] / "contract" / "catalogue.json").read_text())
SERVICES = ("observation", "grounding_dino", "owlvit", "sam2", "sam3", "sam3_tracker", "sam3d", "molmo", "vlm")


@pytest.fixture(scope="module")
def tools():
    registry = load_registry(only=["gap_perception"], entry_points=False)
    assert not registry.broken
    return registry.tools


def test_registering_loads_no_heavy_library():
    code = (
        "from gap_runtime.plugins import load_registry; import sys;"
        "assert not load_registry(only=['gap_perception'], entry_points=False).broken;"
        "print([m for m in ('cv2', 'mujoco', 'sklearn', 'torch', 'dm_control', 'skimage') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_every_tool_looks_and_none_acts(tools):
    assert {t.spec.effect for t in tools.values()} <= {"pure", "sense"}
    assert not any(t.spec.privileged for t in tools.values())


def test_every_catalogue_name_of_perception_is_served(tools):
    names = {name for name in CATALOGUE if name.split(".")[0] in SERVICES}
    assert names and names <= set(tools)
