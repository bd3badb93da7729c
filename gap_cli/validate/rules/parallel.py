"""R1-R4 at the top level: what subgraphs that run side by side may do to each other."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_cli.validate.rules.resources import CLOCK, Hold, clash, holds
from gap_runtime.graph.findings import Finding


def r1_r2_subgraphs_side_by_side(context: WorkflowContext) -> Iterator[Finding]:
    """R1: two subgraphs may hold one actuator at once. R2: one may move the robot while the other senses or moves."""
    if not context.exit_flow.forks:
        return
    nodes = dict(context.subgraph_nodes())
    held = {name: _held(sg) for name, sg in nodes.items()}
    for a, b in combinations(nodes, 2):
        if held[a] and held[b] and context.exit_flow.parallel.may_overlap(a, b):
            yield from _pair(a, b, held[a], held[b])


def _held(sg: SubgraphContext) -> list[tuple[Hold, str]]:
    """Everything a subgraph may hold, each by the first node that does; what streams shares the clock with anyone."""
    found: dict[Hold, str] = {}
    for name in sg.nodes:
        for hold in holds(sg, name):
            if not (hold.resource == CLOCK and name in sg.streaming):
                found.setdefault(hold, name)
    return sorted(found.items())


def _pair(a: str, b: str, ours: list[tuple[Hold, str]], theirs: list[tuple[Hold, str]]) -> Iterator[Finding]:
    clashes = [(x, m, y, n) for x, m in ours for y, n in theirs if clash(x, y)]
    actuators = [c for c in clashes if CLOCK not in (c[0].resource, c[2].resource)]
    hint = f"Let one of the two follow the other: lead from {a!r} to {b!r}."
    for x, m, y, n in actuators[:1]:
        which = x.resource if "*" not in x.resource else y.resource
        message = f"may hold {which} ({m!r}: {x.tool}) while {b!r} runs beside it ({n!r}: {y.tool})"
        yield Finding(f"nodes.{a}", "R1", message, hint)
    for x, m, y, n in () if actuators else clashes[:1]:
        message = f"runs beside {b!r}: {x.tool} of {m!r} and {y.tool} of {n!r} in no order"
        yield Finding(f"nodes.{a}", "R2", f"{message}, so what they do and see would depend on timing", hint)


def r3_loops_beside_branches(context: WorkflowContext) -> Iterator[Finding]:
    """R3: where branches run side by side, a loop has one way in and starts over only when nothing of it still runs."""
    exit_flow = context.exit_flow
    if not exit_flow.forks:
        return
    flow = exit_flow.flow
    for number in sorted(flow.back):
        source, target = flow.arcs[number].source, flow.arcs[number].target
        where = f"nodes.{exit_flow.exits.get(flow.names[source], (flow.names[source],))[0]}"
        if number in flow.irreducible:
            message = f"the loop from {exit_flow.describe(source)} back to {flow.names[target]!r} has a second way in"
            yield Finding(where, "R3", message, "Give the loop one first subgraph.")
            continue
        running = exit_flow.parallel.restarted_under(number, frozenset())
        if running is not None:
            message = f"goes back to {flow.names[target]!r} while {exit_flow.describe(running)} may still run beside it"
            yield Finding(where, "R3", message, "Go back only from where the branches have come together.")


def r4_one_success_end(context: WorkflowContext) -> Iterator[Finding]:
    """R4: two branches lead to two success ends, so that it is chance which one the run reaches."""
    if context.exit_flow.forks:
        for one, other in context.exit_flow.several_ends():
            hint = f"Lead both branches to {one!r}; it waits for both."
            yield Finding(f"nodes.{other}", "R4", f"and {one!r} can both end the same run", hint)


TOP_RULES = (r1_r2_subgraphs_side_by_side, r3_loops_beside_branches, r4_one_success_end)
