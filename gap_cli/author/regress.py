"""Backward search: from a goal through the needs, effects and typed inputs of skills to what holds now."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count

from gap_cli.author.operators import OperatorLibrary, Step, Value
from gap_cli.skills.facts import Fact
from gap_runtime.contracts.types.typeref import TypeRef
from gap_runtime.errors import InstructionError

MAX_STEPS = 12  # per goal; a manipulation segment that needs more is a sign of a contract that never closes
MAX_EXPANDED = 20_000
Available = Mapping[Value, tuple[TypeRef, frozenset[Fact]]]


@dataclass(frozen=True)
class State:
    """What holds and what is known before a goal. A value stays good while the facts established with it hold."""

    facts: frozenset[Fact]
    values: Available = field(default_factory=dict)

    def after(self, steps: Sequence[Step]) -> State:
        """The state once the steps have run."""
        facts, values = self.facts, dict(self.values)
        for step in steps:
            facts = (facts - step.deletes) | step.adds
            values |= {port.value: (port.type, step.adds) for port in step.outputs}
        return State(facts, {v: (t, tied) for v, (t, tied) in values.items() if tied <= facts})


@dataclass(frozen=True)
class _Node:
    """A backward search state: what must still be made true or known, and the steps that follow from there."""

    facts: frozenset[Fact]
    values: frozenset[tuple[Value, TypeRef]]
    steps: tuple[Step, ...]
    cost: float

    @property
    def key(self) -> tuple[float, int, tuple[tuple[str, tuple[tuple[str, str], ...]], ...]]:
        """Cheapest first, then shortest, then by name, so that the same library gives the same plan."""
        return self.cost, len(self.steps), tuple((s.skill, s.binding) for s in self.steps)


def regress(
    goal: Fact, state: State, operators: OperatorLibrary, objects: Sequence[str], keep: frozenset[Fact] = frozenset()
) -> list[Step]:
    """The cheapest steps that bring the goal about from `state` without ending any fact in `keep`.

    Raises `InstructionError` naming what no skill provides.
    """
    start = _Node(frozenset({goal}), frozenset(), (), 0.0)
    order = count()
    queue = [(start.key, next(order), start)]
    seen: set[tuple[frozenset[Fact], frozenset[tuple[Value, TypeRef]]]] = set()
    nearest = start
    while queue and len(seen) < MAX_EXPANDED:
        _, _, node = heapq.heappop(queue)
        node = replace(node, values=frozenset(w for w in node.values if not _known(w, state)))
        if node.facts <= state.facts and not node.values:
            return list(node.steps)
        if (node.facts, node.values) in seen:
            continue
        seen.add((node.facts, node.values))
        nearest = min(nearest, node, key=lambda n: (_open(n, state), n.key))
        for earlier in _predecessors(node, state, operators, objects, keep):
            heapq.heappush(queue, (earlier.key, next(order), earlier))
    raise _no_plan(goal, nearest, state, operators)


def _known(want: tuple[Value, TypeRef], state: State) -> bool:
    value, type_ = want
    return value in state.values and type_.accepts(state.values[value][0])


def _open(node: _Node, state: State) -> int:
    return len(node.facts - state.facts) + len(node.values) if node.steps else 10**6


def _predecessors(
    node: _Node, state: State, operators: OperatorLibrary, objects: Sequence[str], keep: frozenset[Fact]
) -> Iterator[_Node]:
    """The node regressed over every step that supplies something it lacks and destroys nothing it needs."""
    if len(node.steps) >= MAX_STEPS:
        return
    seen: set[tuple[str, tuple[tuple[str, str], ...]]] = set()
    for step in _relevant(node, state, operators, objects):
        if (step.skill, step.binding) in seen or step.deletes & (node.facts | keep):
            continue
        seen.add((step.skill, step.binding))
        rest = frozenset(w for w in node.values if not _gives(step, w))
        yield _Node(
            (node.facts - step.adds) | step.needs,
            rest | {(port.value, port.type) for port in step.required},
            (step, *node.steps),
            node.cost + step.cost,
        )


def _relevant(node: _Node, state: State, operators: OperatorLibrary, objects: Sequence[str]) -> Iterator[Step]:
    # A fact that holds now may have been ended by a step in between, so facts that hold are regressed too.
    for fact in sorted(node.facts):
        yield from operators.achieving(fact, objects)
    for value, type_ in sorted(node.values, key=lambda w: (w[0], str(w[1]))):
        yield from operators.producing(value, type_, objects)


def _gives(step: Step, want: tuple[Value, TypeRef]) -> bool:
    return any(port.value == want[0] and want[1].accepts(port.type) for port in step.outputs)


def _no_plan(goal: Fact, nearest: _Node, state: State, operators: OperatorLibrary) -> InstructionError:
    """Name what is missing where the search came closest, and the skills that were out of reach."""
    missing = [str(f) for f in sorted(nearest.facts - state.facts)]
    missing += [f"{value.name} of {value.of} ({type_})" for value, type_ in sorted(nearest.values, key=str)]
    out = "; ".join(f"{name}: {why}" for name, why in sorted(operators.left_out.items()))
    usable = ", ".join(operators.operators) or "none"
    return InstructionError(
        f"No skill brings about {', '.join(missing)}, which {goal} takes.",
        hint=f"Usable skills: {usable}." + (f" Left out: {out}." if out else ""),
    )
