"""Goals as data: what shall hold of which things, in which order; the content of goals.json."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from pydantic import Field

from gap_runtime.contracts.models import Document

EACH = "each"  # the object a `ForEach` is about, as its goal spells it


class Predicate(Document):
    """A fact that shall hold: `{"predicate": "in", "roles": {"target": "milk", "container": "basket"}}`.

    Roles map, in the order of the fact's arguments, to ids of objects and joints of the task.
    """

    predicate: str
    roles: dict[str, str] = Field(min_length=1)

    @property
    def fact(self) -> str:
        """As skill contracts write it: `in(milk, basket)`."""
        return f"{self.predicate}({', '.join(self.roles.values())})"

    def of(self, thing: str) -> Predicate:
        """The same with `thing` in the place of `EACH`."""
        return Predicate(predicate=self.predicate, roles={r: thing if v == EACH else v for r, v in self.roles.items()})


class ForEach(Document):
    """The goal for every one of these objects, or for any `count` of them, in any order."""

    each: list[str] = Field(min_length=1)
    count: int | None = Field(default=None, ge=1)
    goal: Predicate

    def chosen(self) -> list[Predicate]:
        """The goal for each object that it takes: all of them, or the first `count`."""
        return [self.goal.of(thing) for thing in self.each[: self.count]]


class Group(Document):
    """Goals to be reached in any order, or one after the other. Plans follow the order they are written in."""

    order: Literal["any", "sequence"] = "any"
    goals: list[Predicate | ForEach | Group] = Field(min_length=1)

    def parts(self) -> Iterator[Predicate | ForEach]:
        """The goals without their groups, in order."""
        for goal in self.goals:
            yield from goal.parts() if isinstance(goal, Group) else (goal,)

    def predicates(self) -> list[Predicate]:
        """Every fact that shall hold in the end, in order."""
        return [p for part in self.parts() for p in (part.chosen() if isinstance(part, ForEach) else (part,))]


class Goals(Group):
    """The content of goals.json: what shall be reached in which scene of a task."""

    schema_: Literal["gap/goals/v1"] = Field(default="gap/goals/v1", alias="schema")
    scene: str

    @property
    def data(self) -> dict[str, Any]:
        """Plain data, schema first, defaults that say nothing left out."""
        given = self.model_dump(mode="json", by_alias=True, exclude_defaults=True)
        return {"schema": self.schema_, "scene": self.scene, "order": self.order, "goals": given["goals"]}


def same_goals(one: Group, other: Group) -> bool:
    """True when the two ask for the same, whatever their scenes, the spelling of roles, and nesting that says nothing.

    A goal for every one of several objects is the same as a goal for each.
    """
    return bool(_canonical(one) == _canonical(other))


def _canonical(goal: Predicate | ForEach | Group) -> Any:
    """Text for a fact, a frozenset for goals in any order, a tuple for a sequence."""
    if isinstance(goal, Predicate):
        return goal.fact
    if isinstance(goal, ForEach):
        if goal.count is not None and goal.count < len(goal.each):
            return f"{goal.count} of {sorted(goal.each)}: {goal.goal.fact}"
        return _canonical(Group(goals=list(goal.chosen())))
    kind = frozenset if goal.order == "any" else tuple
    parts: list[Any] = []
    for part in map(_canonical, goal.goals):
        parts += part if isinstance(part, kind) else [part]
    return kind(parts) if len(parts) > 1 else parts[0]
