"""Reads what language models answer: yes or no, and the points Molmo writes, of both generations."""

from __future__ import annotations

import re

from gap_runtime.contracts.failures import PerceptionError

ASK = "Answer with yes or no only."
_FIRST = re.compile(r"[\s*_`\"'(]*(yes|no)\b", re.IGNORECASE)
_TAG = re.compile(r'<(?:points?|tracks)\b[^>]*?\bcoords="([^"]*)"')
_IN_TAG = re.compile(r"(?<!\d)(\d+) (\d{3,4}) (\d{3,4})(?!\d)")  # index, x, y in thousandths of the image
_PERCENT = re.compile(r'\bx\d*="\s*(\d+(?:\.\d+)?)"\s+y\d*="\s*(\d+(?:\.\d+)?)"')


def yes_or_no(answer: str) -> bool:
    """True for an answer that begins with yes, False with no. Raises `PerceptionError` (`cannot_answer`) otherwise."""
    first = _FIRST.match(answer)
    if first is None:
        raise PerceptionError("cannot_answer", f"The model answered {answer.strip()[:120]!r}: neither yes nor no.")
    return first[1].lower() == "yes"


def points(answer: str) -> list[tuple[float, float]]:
    """Points of an answer as fractions (x, y) of the image's width and height, in the order written.

    Molmo 2 writes `<points coords="1 1 512 334 2 700 410">mug</points>` (image, then index, x, y in thousandths);
    Molmo writes `<point x="51.2" y="33.4">` or `x1=... y1=...` (per cent). Numbers beyond the image are no points.
    """
    found = [(int(x) / 1000, int(y) / 1000) for tag in _TAG.findall(answer) for _, x, y in _IN_TAG.findall(tag)] or [
        (float(x) / 100, float(y) / 100) for x, y in _PERCENT.findall(answer)
    ]
    return [(x, y) for x, y in found if x <= 1 and y <= 1]


def pixel(point: tuple[float, float], columns: int, rows: int) -> tuple[int, int]:
    """The pixel (x, y) a fractional point falls on."""
    return min(int(point[0] * columns), columns - 1), min(int(point[1] * rows), rows - 1)
