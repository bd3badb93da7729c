"""Groups failed episodes into modes and names the first node that deviated, with numbers, from the recorded rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gap_cli.refine.statistics import Row
from gap_cli.rehearse.summary import failures

SLACK = 0.01  # m beyond what successes moved a body by, from which a node deviated
EXAMPLES = 3


@dataclass(frozen=True)
class Mode:
    """One way to fail: the subgraph it ended in and why, how often, and on which seeds. `first` is the node that first
    did what it did in no success, in most of these episodes, and `numbers` what it did there, by example seed."""

    stage: str
    cause: str
    reason: str
    count: int
    seeds: tuple[int, ...]
    first: str
    numbers: Mapping[str, str]

    @property
    def data(self) -> dict[str, Any]:
        """As plain data."""
        return {**asdict(self), "seeds": list(self.seeds), "numbers": dict(self.numbers)}


def diagnose(rows: Sequence[Row]) -> list[Mode]:
    """The modes of the failed episodes, most frequent first."""
    usual = _usual([row for row in rows if row["success"]])
    by_seed = {row["seed"]: row for row in rows}
    modes = []
    for group in failures(rows):
        found = {seed: _first_deviation(by_seed[seed], usual) for seed in group["seeds"]}
        nodes = [node for node, _ in found.values() if node]
        first = max(dict.fromkeys(nodes), key=nodes.count, default="")
        shown = [seed for seed in group["seeds"] if found[seed][0] == first][:EXAMPLES]
        numbers = {str(seed): found[seed][1] for seed in shown}
        modes.append(
            Mode(group["stage"], group["cause"], group["reason"], group["count"], tuple(group["seeds"]), first, numbers)
        )
    return modes


def _usual(solved: Sequence[Row]) -> dict[tuple[str, str], float]:
    """By node and what it changed: the most that any success changed it by; contacts count as present."""
    most: dict[tuple[str, str], float] = {}
    for row in solved:
        for node in row.get("nodes", ()):
            for key, size in _effects(node):
                most[node["node"], key] = max(size, most.get((node["node"], key), 0.0))
    return most


def _first_deviation(row: Row, usual: Mapping[tuple[str, str], float]) -> tuple[str, str]:
    """The first node that failed or did what no success did, and what; two empty texts where none did."""
    for node in row.get("nodes", ()):
        for key, size in _effects(node):
            most = usual.get((node["node"], key))
            if usual and (most is None or size > most + SLACK):
                return node["node"], f"{key} {size:.3f}" + (f" (successes: at most {most:.3f})" if most else "")
        if not node["ok"]:
            return node["node"], node["error"]
    return "", ""


def _effects(node: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """What a node did to the world besides moving the arm: by name, how far; 1 for a contact."""
    for name, change in node["changes"].items():
        if name.startswith("arm:"):
            continue
        if "moved" in change:
            yield f"{name} moved [m]", float(np.linalg.norm(change["moved"]))
        if "turned_deg" in change:
            yield f"{name} turned [rad]", float(np.radians(change["turned_deg"]))
        for contact in change.get("contacts", ()):
            yield f"{name} contact {contact}", 1.0
