"""A canonical script that someone edited runs in the jail, and finds there what it imports."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from gap_cli.sandbox import ScriptJail
from gap_runtime.contracts.types import CameraObservation, DepthImage, Detection, Image, Matrix3x3, Se3Pose
from gap_runtime.errors import PerceptionError
from tests.unit.skills.stage import LIBRARY

CAMERA = CameraObservation(
    "top", Image(np.full((4, 5, 3), 7)), DepthImage(np.ones((4, 5))), Matrix3x3(np.eye(3)), Se3Pose.of(np.eye(4)), 1.5
)
ASKED = {"cameras": [CAMERA], "object_name": "can", "prompt": "which?"}


class Found(NamedTuple):
    """What a detector gives."""

    detections: list[Detection]


@pytest.fixture(scope="module")
def jail():
    with ScriptJail() as made:
        if made.level() == "none":
            pytest.skip("this kernel has no seccomp: nothing would run")
        yield made


@pytest.mark.parametrize(
    ("skill", "name"), [("perception-single", "perceive_dino_vlm"), ("perception-any", "pick_mark")]
)
def test_an_edited_perception_script_finds_the_shared_room(jail, tmp_path, skill, name):
    file = tmp_path / "edited.py"
    file.write_text(LIBRARY[skill].scripts[name].read_text() + "\n# edited\n")
    with pytest.raises(PerceptionError, match="No camera shows"):
        jail.run(file, ASKED, lambda name, given: Found([]), 30.0)
