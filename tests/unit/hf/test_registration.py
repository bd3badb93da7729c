"""Provider `hf` serves the embedded tools' contracts, is chosen only when asked for, and costs nothing until then."""

from __future__ import annotations

import subprocess
import sys

import pytest

from gap_runtime.plugins import load_registry

SERVED = {
    "grounding_dino.Detect", "owlvit.Detect", "sam2.SegmentBox", "sam2.SegmentPoint", "sam3.SegmentText",
    "sam3.SegmentPoint", "sam3.SegmentBox", "sam3_tracker.InitTracker", "sam3_tracker.UpdateTracker",
    "sam3_tracker.CloseTracker", "molmo.PointPrompt", "molmo.Query", "molmo.QueryYesNo", "vlm.Query", "vlm.QueryYesNo",
    "graspgen.PlanFromPointCloud", "graspnet.PlanFromDepth", "graspnet.PlanFromPointCloud", "m2t2.PlanFromPointCloud",
    "curobo.PlanToGraspPoses", "curobo.PlanToPose",
}  # fmt: skip


@pytest.fixture(scope="module")
def registry():
    return load_registry(entry_points=False)


def test_every_learned_service_has_a_provider(registry):
    assert {name for name, by in registry.providers.items() if "hf" in by} == SERVED


@pytest.mark.parametrize("name", sorted(SERVED))
def test_the_contract_is_the_embedded_providers(registry, name):
    served, embedded = registry.providers[name]["hf"], registry.providers[name]["embedded"]
    assert served.spec.schema_hash == embedded.spec.schema_hash
    assert served.plugin == ("gap_motion" if name.startswith("curobo.") else "gap_hf")
    assert served.notes, "it says for itself how it does it"


def test_it_serves_when_chosen_and_only_then(registry):
    assert registry.tool("sam2.SegmentBox").provider == "embedded"
    registry.choose("sam2.*", "hf")
    assert registry.tool("sam2.SegmentBox").provider == "hf"
    assert registry.tool("sam3.SegmentBox").provider == "embedded"


def test_registering_loads_none_of_the_libraries():
    heavy = ("torch", "transformers", "httpx2", "zmq", "cv2", "PIL", "ompl", "mujoco")
    code = (
        "import sys\nfrom gap_runtime.plugins import load_registry\n"
        "registry = load_registry(('gap_perception', 'gap_grasps', 'gap_motion', 'gap_hf'), entry_points=False)\n"
        f"print(registry.broken, [m for m in {heavy!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "{} []"
