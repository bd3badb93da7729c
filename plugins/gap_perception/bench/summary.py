"""Sums up judged searches: rates, errors and times, overall and by any key of the rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

MIN_VISIBLE = 100  # pixels over all cameras from which an object counts as visible
Row = Mapping[str, Any]


def summarise(rows: Iterable[Row]) -> dict[str, float]:
    """Precision, recall, wrong-object rate, mask IoU, centre and yaw errors, and time, over all rows; NaN for none."""
    rows = list(rows)
    if not rows:
        return {}
    there = [r for r in rows if is_visible(r)]
    found = [r for r in rows if r["found"]]
    right = [r for r in found if not r["wrong"]]
    centre, yaw = _values(right, "center_mm"), _values(right, "yaw_deg")
    ms = _values(rows, "ms")
    return {
        "scenes": len({r["seed"] for r in rows}),
        "searches": len(rows),
        "precision": len(right) / max(len(found), 1),
        "recall": len([r for r in there if r["found"] and not r["wrong"]]) / max(len(there), 1),
        "wrong_rate": len([r for r in rows if r["wrong"]]) / len(rows),
        "iou_median": float(np.median(_values(right, "iou"))),
        "center_mm_median": float(np.median(centre)),
        "center_mm_p95": float(np.quantile(centre, 0.95)),
        "yaw_deg_median": float(np.median(yaw)),
        "yaw_deg_p95": float(np.quantile(yaw, 0.95)),
        "ms_median": float(np.median(ms)),
        "ms_p95": float(np.quantile(ms, 0.95)),
    }


def by(rows: Iterable[Row], *keys: str) -> dict[tuple[str, ...], dict[str, float]]:
    """`summarise` per combination of values of `keys` (`sensor`, `clutter`, `object`), in order of appearance."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(str(row[key]) for key in keys), []).append(row)
    return {values: summarise(group) for values, group in groups.items()}


def is_visible(row: Row) -> bool:
    """Whether the object was there to be seen."""
    return bool(row["present"] and row["pixels"] >= MIN_VISIBLE)


def _values(rows: Iterable[Row], key: str) -> list[float]:
    """The rows' numbers under `key`; one NaN when there are none."""
    return [r[key] for r in rows if r[key] is not None] or [float("nan")]
