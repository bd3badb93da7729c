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


def test_the_benchmark_counts_what_was_found_missed_and_mistaken(cell, present, registry):
    from gap_perception.bench import by, summarise
    from gap_perception.bench_run import report

    def row(name, there, found, wrong=False):
        right = {"iou": 0.9, "center_mm": 1.0, "yaw_deg": None} if found and not wrong else {}
        base = {"seed": 1, "clutter": "usual", "sensor": "clean", "object": name, "present": there, "ms": None}
        return base | {"found": found, "wrong": wrong, "pixels": 500 if there else 0} | right

    rows = [row("a", True, True), row("b", True, False), row("c", False, False), row("d", False, True, wrong=True)]
    numbers = summarise(rows)
    assert (numbers["precision"], numbers["recall"], numbers["wrong_rate"]) == (0.5, 0.5, 0.25)
    assert by(rows, "object")["a"]["recall"] == 1 and summarise([]) == {}
    table = report(rows)
    assert {len(line) for line in table.rows} == {len(table.columns)}
    assert [line[0] for line in table.rows][:2] == ["clean", "clean, usual"]
