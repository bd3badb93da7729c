"""A plan: which skill for which segment, over which objects, in which scene; as data and as builder code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from pydantic import Field

from gap_cli.author.render import render
from gap_cli.contracts.models import Document

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
    """Entries and routes of the top level.

    The first layer starts side by side and joins in what follows. A route leads to one node, so a later layer of
    several segments runs them one after the other.
    """
    first = [s for s in segments if s.layer == segments[0].layer]
    later = [s for s in segments if s.layer != segments[0].layer]
    order = [*([first] if later or len(first) == 1 else [[s] for s in first]), *([s] for s in later)]
    routes: dict[str, Mapping[str, str]] = {}
    for stage, following in zip(order, [*order[1:], None], strict=True):
        target = following[0].name if following else DONE
        for segment in stage:
            routes[segment.name] = {**dict.fromkeys(segment.exits, target), segment.on_error: ABORT}
    return {"entries": [s.name for s in order[0]], "routes": routes}
