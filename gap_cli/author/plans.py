"""A plan: which skill for which segment, over which objects, in which scene; as data and as builder code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal

from pydantic import Field

from gap_cli.author.render import render
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.task.goals import Goals, Group

SCHEMA: Literal["gap/plan/v1"] = "gap/plan/v1"
DONE, ABORT = "done", "abort"


class Segment(Document):
    """One use of a skill. `roles` maps the skill's roles to object ids; `names`, `literals` and `parameters` are what
    its template and the graph are filled with; `why` is why this skill.

    Segments of one `layer` run side by side, and what they lead to is the next layer. `after` says otherwise, by exit:
    segments or ends; a segment without a layer is only reached so. In a loop the object `item` stands for is one of
    `each`, and its head has `max_visits`.
    """

    name: str
    skill: str
    description: str = ""
    stage: str | None = None
    layer: int | None = Field(default=None, ge=0)
    roles: dict[str, str] = {}
    names: dict[str, str] = {}
    literals: dict[str, Any] = {}
    parameters: dict[str, Any] = {}
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    exits: list[str] = Field(min_length=1)
    on_error: str
    after: dict[str, list[str]] = {}
    each: list[str] = []
    max_visits: int | None = Field(default=None, ge=1)
    why: str = ""


class PlanData(Document):
    """The content of plan.json."""

    schema_: Literal["gap/plan/v1"] = Field(default=SCHEMA, alias="schema")
    task: str
    variant: str = ""
    instruction: str
    author: str
    scene: str
    goals: Group | None = None
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

    @property
    def goals(self) -> Goals | None:
        """The content of goals.json; None for a plan that is not for any goal."""
        given = self.content.goals
        return None if given is None else Goals(scene=self.content.scene, order=given.order, goals=given.goals)

    @classmethod
    def of(cls, content: PlanData) -> Plan:
        """The plan with its code and its page rendered."""
        given: dict[str, Any] = content.model_dump(mode="json") | edges(content.segments)
        given["facts"] = [p.fact for p in content.goals.predicates()] if content.goals else []
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
    rows = [
        [s.name for s in row] for _, row in groupby((s for s in segments if s.layer is not None), lambda s: s.layer)
    ]
    following = {name: targets for row, targets in zip(rows, [*rows[1:], [DONE]], strict=True) for name in row}
    routes: dict[str, Mapping[str, str]] = {}
    links: dict[tuple[str, str], None] = {}
    for segment in segments:
        after = {exit_: following.get(segment.name, [ABORT]) for exit_ in segment.exits}
        after |= {segment.on_error: [ABORT], **segment.after}
        routes[segment.name] = {exit_: targets[0] for exit_, targets in after.items() if len(targets) == 1}
        links |= {(segment.name, target): None for targets in after.values() if len(targets) > 1 for target in targets}
    return {"entries": rows[0], "links": list(links), "routes": routes}
