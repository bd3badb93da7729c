"""Typed changes to a plan: swap a skill, tune a parameter, look at another part, try again, drop a segment."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from gap_cli.author.plans import PlanData, Segment
from gap_runtime.contracts.models import Document
from gap_runtime.errors import RunError

Edit = Callable[[Segment], Segment]


class Swap(Document):
    """Another skill in the place of a segment's, with `literals` of its own; parameters go back to its defaults."""

    kind: Literal["swap"] = "swap"
    segment: str
    skill: str
    literals: dict[str, Any] = {}

    def apply(self, plan: PlanData) -> PlanData:
        """The changed plan. Raises `RunError` where there is no such segment."""
        return _edited(
            plan,
            self.segment,
            lambda s: s.model_copy(
                update={"skill": self.skill, "parameters": {}, "literals": {**s.literals, **self.literals}}
            ),
        )


class Tune(Document):
    """Other values of declared parameters, by segment and name."""

    kind: Literal["tune"] = "tune"
    values: dict[str, dict[str, Any]]

    def apply(self, plan: PlanData) -> PlanData:
        """The changed plan. Raises `RunError` where there is no such segment."""
        for name, values in self.values.items():
            given = {**find(plan, name).parameters, **values}
            plan = _edited(plan, name, partial(_updated, parameters=given))
        return plan


class Rephrase(Document):
    """Other literals of a segment: the words or the part that perception looks for."""

    kind: Literal["rephrase"] = "rephrase"
    segment: str
    literals: dict[str, Any]

    def apply(self, plan: PlanData) -> PlanData:
        """The changed plan. Raises `RunError` where there is no such segment."""
        return _edited(plan, self.segment, lambda s: s.model_copy(update={"literals": {**s.literals, **self.literals}}))


class Drop(Document):
    """A segment left out, whose outputs nobody reads."""

    kind: Literal["drop"] = "drop"
    segment: str

    def apply(self, plan: PlanData) -> PlanData:
        """The changed plan. Raises `RunError` where there is no such segment, or others lead to it by name."""
        find(plan, self.segment)
        left = [s for s in plan.segments if s.name != self.segment]
        if any(self.segment in targets for s in left for targets in s.after.values()):
            raise RunError(f"Segment {self.segment!r} is where a failure of another leads; it cannot be left out.")
        return plan.model_copy(update={"segments": left})


class Retry(Document):
    """A segment tried again where it fails: its failure leads to `again` (a segment that looks anew, or itself), which
    may then be entered `visits` times."""

    kind: Literal["retry"] = "retry"
    segment: str
    again: str
    visits: int = Field(default=2, ge=2, le=10)

    def apply(self, plan: PlanData) -> PlanData:
        """The changed plan. Raises `RunError` where there is no such segment."""
        plan = _edited(
            plan, self.segment, lambda s: s.model_copy(update={"after": {**s.after, s.on_error: [self.again]}})
        )
        return _edited(plan, self.again, lambda s: s.model_copy(update={"max_visits": self.visits}))


Change = Annotated[Swap | Tune | Rephrase | Drop | Retry, Field(discriminator="kind")]
CHANGES: TypeAdapter[Change] = TypeAdapter(Change)


class Patch(Document):
    """The content of patch.json: what is changed, who proposed it, why, and on what evidence (seeds, numbers)."""

    schema_: Literal["gap/patch/v1"] = Field(default="gap/patch/v1", alias="schema")
    change: Change
    proposer: str
    reason: str
    evidence: dict[str, Any] = {}

    @property
    def title(self) -> str:
        """The change in a few words."""
        match self.change:
            case Swap():
                return f"swap {self.change.segment}: {self.change.skill}"
            case Tune():
                pairs = [(s, n, v) for s, values in self.change.values.items() for n, v in values.items()]
                return "tune " + ", ".join(f"{s}.{n} = {v}" for s, n, v in pairs)
            case Rephrase():
                return f"rephrase {self.change.segment}: {', '.join(map(str, self.change.literals.values()))}"
            case Drop():
                return f"drop {self.change.segment}"
            case Retry():
                return f"retry {self.change.segment} by {self.change.again}, {self.change.visits} visits"


def find(plan: PlanData, name: str) -> Segment:
    """The segment of that name. Raises `RunError`."""
    for segment in plan.segments:
        if segment.name == name:
            return segment
    raise RunError(f"The plan has no segment {name!r}.", hint=f"Segments: {', '.join(s.name for s in plan.segments)}.")


def _updated(segment: Segment, **values: Any) -> Segment:
    return segment.model_copy(update=values)


def _edited(plan: PlanData, name: str, edit: Edit) -> PlanData:
    find(plan, name)
    return plan.model_copy(update={"segments": [edit(s) if s.name == name else s for s in plan.segments]})
