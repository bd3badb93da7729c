"""The perception benchmark as tables: goals beside what was reached, then by sensor, clutter and object."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from gap_perception.bench.perception import CLEAN
from gap_perception.bench.scenes import LEVELS
from gap_perception.bench.summary import MIN_VISIBLE, by, summarise
from gap_perception.bench.truth import FOUND
from gap_runtime.contracts.bench import BenchReport, Picture, Table
from gap_runtime.contracts.task.sensors import CameraNoise

PACKAGES = ("mujoco", "numpy", "scipy", "opencv-python-headless", "scikit-learn")
MEASURES = {
    "scenes": "scenes", "searches": "searches", "precision": "precision", "recall": "recall",
    "wrong_rate": "wrong object", "iou_median": "mask IoU", "center_mm_median": "centre median [mm]",
    "center_mm_p95": "centre p95 [mm]", "yaw_deg_median": "yaw median [deg]", "yaw_deg_p95": "yaw p95 [deg]",
    "ms_median": "median [ms]", "ms_p95": "p95 [ms]",
}  # fmt: skip
SHARES = {"precision", "recall", "wrong_rate", "iou_median"}


class Goal(NamedTuple):
    """What a measure should not exceed at a noise level."""

    sensor: str
    measure: str
    limit: float


GOALS = (
    Goal(CLEAN, "wrong_rate", 0.005),
    Goal(CLEAN, "center_mm_median", 4.0),
    Goal(CLEAN, "center_mm_p95", 10.0),
    Goal(CLEAN, "ms_median", 250.0),
    Goal(CLEAN, "ms_p95", 250.0),
    Goal("realistic", "wrong_rate", 0.02),
    Goal("realistic", "center_mm_p95", 15.0),
)


def report(
    rows: Sequence[Mapping[str, Any]], models: Mapping[str, CameraNoise], pictures: tuple[Picture, ...], first: int
) -> BenchReport:
    """All tables of judged searches at the noise levels of `models`; `first` is the first seed."""
    return BenchReport(
        "Perception on random cluttered scenes",
        ("sensor", "measure", "goal: at most", "reached", "met"),
        _goals(rows),
        (*NOTES, f"Seeds from {first} on.", *(_model_note(name, model) for name, model in models.items())),
        PACKAGES,
        (
            _table("By sensor", rows, MEASURES, "sensor"),
            _table("By clutter", rows, MEASURES, "sensor", "clutter"),
            # Which object is looked for first, and so pays for the scene, says nothing about the object.
            _table("By object", rows, [m for m in MEASURES if not m.startswith("ms")], "sensor", "object"),
        ),
        pictures,
    )


def _goals(rows: Sequence[Mapping[str, Any]]) -> tuple[tuple[Any, ...], ...]:
    """One row per goal whose sensor was measured."""
    found = []
    for goal in GOALS:
        summary = summarise([r for r in rows if r["sensor"] == goal.sensor])
        if summary:
            reached = summary[goal.measure]
            met = "yes" if reached <= goal.limit else "no"
            found.append((goal.sensor, MEASURES[goal.measure], goal.limit, _rounded(goal.measure, reached), met))
    return tuple(found)


def _table(title: str, rows: Sequence[Mapping[str, Any]], measures: Iterable[str], *keys: str) -> Table:
    """A line per combination of the keys' values: sensors as measured, clutter as declared, objects by name."""
    measures, groups = list(measures), by(rows, *keys)
    sensors = list(dict.fromkeys(values[0] for values in groups))
    clutters = [level.name for level in LEVELS]

    def place(values: tuple[str, ...]) -> tuple[Any, ...]:
        return (sensors.index(values[0]), *(clutters.index(v) if v in clutters else v for v in values[1:]))

    lines = [
        (
            *(value.replace("_", " ") for value in values),
            *(_rounded(name, groups[values][name]) for name in measures),
        )
        for values in sorted(groups, key=place)
    ]
    return Table(title, (*keys, *(MEASURES[name] for name in measures)), tuple(lines))


def _rounded(measure: str, number: float) -> float | int | str:
    if isinstance(number, int):
        return number
    if not math.isfinite(number):
        return ""
    return round(number, 4 if measure in SHARES else 1)


NOTES = (
    "Every object of the task is searched for in every scene, in it or not, by the skill's own script.",
    "Wrong object: the box of another object or of none, or more than "
    f"{1e3 * FOUND:g} mm off, among all searches. Precision: right among found.",
    f"Recall counts objects with {MIN_VISIBLE} pixels or more in view. Mask IoU (median), centre and yaw errors are of "
    "right boxes, by the simulator's truth; yaw only of objects that are not square from above.",
    "; ".join(
        f"{level.name.capitalize()}: {level.objects} objects {1e3 * level.gap:g} mm apart or more" for level in LEVELS
    )
    + "; standing, at any yaw, and a basket.",
    "Time: processor time on one core from two cameras' frames to a box, for the first search in a scene; later ones "
    "in the same frames take a tenth of it. Rendering is left out.",
    "A goal is met or not by the numbers of this run; no seed of it was used to improve anything.",
)


def _model_note(name: str, model: CameraNoise) -> str:
    """What a noise model of the task does, in numbers; its sources stand beside it in task.yaml."""
    parts = []
    if model.depth is not None:
        depth = model.depth
        parts = [
            f"depth noise {1e3 * depth.deviation(1.0):.2g} mm at 1 m, growing with its square",
            f"{100 * depth.dropout:g} % dropout", f"edges frayed by {depth.jitter:g} px",
            f"no depth where the second imager, {1e3 * depth.baseline:g} mm aside, sees nothing",
        ]  # fmt: skip
    parts += [
        f"colour noise {model.colour:g} levels",
        f"light ±{100 * model.light:g} %",
        f"calibration off by {1e3 * model.shift:g} mm and {model.turn:g}° (rms) per camera and scene",
    ]
    return f"Sensor {name}: {', '.join(parts)}."
