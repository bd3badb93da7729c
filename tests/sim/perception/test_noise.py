import numpy as np
import pytest

from gap_perception.bench_noise import SENSORS, degrade
from gap_perception.frames import remember

pytestmark = pytest.mark.sim


@pytest.fixture(scope="module")
def clean(cell, present):
    return cell.world.observe()


def test_a_clean_sensor_changes_nothing(clean):
    degraded = degrade(clean, SENSORS[0], seed=0)
    for a, b in zip(clean.cameras, degraded.cameras, strict=True):
        assert a.rgb == b.rgb and a.depth == b.depth and np.allclose(a.pose.matrix, b.pose.matrix)


def test_the_same_seed_degrades_the_same_way(clean):
    assert degrade(clean, SENSORS[2], seed=3) == degrade(clean, SENSORS[2], seed=3)
    assert degrade(clean, SENSORS[2], seed=3) != degrade(clean, SENSORS[2], seed=4)


@pytest.mark.parametrize("sensor", SENSORS[:3], ids=lambda s: s.name)
def test_real_sensors_are_enough_to_tell_the_groceries_apart(cell, clean, present, sensor):
    cell.state.clear()
    frames = degrade(clean, sensor, seed=1)
    remember(cell.state, frames)
    for name, model in cell.task.objects.items():
        found = cell.tool("grounding_dino.Detect", image=frames.cameras[0].rgb, text_prompt=model.label).detections
        assert len(found) == (name in present), name
