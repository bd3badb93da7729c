"""A plan: which skill for which segment, over which objects, in which scene; as data and as builder code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

from pydantic import Field

from gap_cli.author.render import render
from gap_runtime.contracts.models import Document

SCHEMA: Literal["gap/plan/v1"] = "gap/plan/v1"
DONE, ABORT = "done", "abort"


class PlannedGoal(Document):
    """One goal: the fact, and its objects by the names success conditions use."""

    fact: str
    target: str
    container: str


class Segment(Document):
    """One use of a skill. `roles` maps the skill's roles to object ids; `names`, `literals` and `parameters` are what
    its template and the graph are filled with; segments of one `layer` run side by side."""

    name: str
    skill: str
    description: str = ""
    stage: str | None = None
    layer: int = Field(ge=0)
    roles: dict[str, str] = {}
    names: dict[str, str] = {}
    literals: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    exits: list[str] = Field(min_length=1)
    on_error: str


class PlanData(Document):
    """The content of plan.json."""

    schema_: Literal["gap/plan/v1"] = Field(default=SCHEMA, alias="schema")
    task: str
    variant: str = ""
    instruction: str
    author: str
    scene: str
    goals: list[PlannedGoal]
    segments: list[Segment] = Field(min_length=1)
    recovery: list[str] = []


@dataclass(frozen=True)
class Plan:
    """What a planner hands on: `data` (plan.json), `source` (spec.py, builder code) and `markdown` (plan.md)."""

    content: PlanData
    source: str
    markdown: str

    @property
    def data(self) -> dict[str, Any]:
        """Plain data in a fixed key order, defaults included."""
        return self.content.model_dump(mode="json", by_alias=True)

    @classmethod
    def of(cls, content: PlanData) -> Plan:
        """The plan with its code and its page rendered."""
        given: dict[str, Any] = content.model_dump(mode="json") | edges(content.segments)
        return cls(content, render("spec.py.j2", **given), render("plan.md.j2", **given))

    @classmethod
    def load(cls, data: Any, where: str = "plan.json", source: str | None = None) -> Plan:
        """From the content of plan.json and, where someone edited it, spec.py. Raises `DocumentError`."""
        plan = cls.of(PlanData.load(data, where))
        return plan if source is None else cls(plan.content, source, plan.markdown)


def edges(segments: Sequence[Segment]) -> dict[str, Any]:
    """Entries, plain edges and routes of the top level.

    The segments of one layer run side by side, and each waits for every segment of the layer before. Where an exit
    leads to one segment its route says so; where success leads to several, plain edges do.
    """
    layers = [list(group) for _, group in groupby(segments, key=lambda s: s.layer)]
    routes: dict[str, Mapping[str, str]] = {}
    links: list[tuple[str, str]] = []
    for layer, following in zip(layers, [*layers[1:], []], strict=True):
        targets = [s.name for s in following] or [DONE]
        for segment in layer:
            success = dict.fromkeys(segment.exits, targets[0]) if len(targets) == 1 else {}
            routes[segment.name] = {**success, segment.on_error: ABORT}
            links += [(segment.name, target) for target in targets if not success]
    return {"entries": [s.name for s in layers[0]], "links": links, "routes": routes}
