"""R1-R4: what parallel branches may do to each other, within a subgraph and at the top level."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, islice
from typing import Any, NamedTuple

from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import Finding
from gap_runtime.graph.references import has_reference

CLOCK = "clock"
MAX_PER_NODE = 8  # a node beside a hundred others has one mistake, not a hundred


class Hold(NamedTuple):
    """A resource a node may hold while it runs, by which tool; `shared` with other sharers."""

    resource: str
    shared: bool
    tool: str


def holds(sg: SubgraphContext, name: str) -> list[Hold]:
    """Everything a node may hold. A resource that depends on an input not known before the run is any of its kind."""
    callee = sg.callees[name]
    if callee is None:
        return []
    known: dict[str, Any] = {}
    if callee.what.startswith("tool ") and any("{" in resource for spec in callee.tools for resource in spec.resources):
        inputs = sg.nodes[name].inputs
        given = {p.name: inputs.get(p.name, p.default) for p in callee.inputs.values()}
        known = {name: value for name, value in given.items() if not has_reference(value)}
    found = {h for spec in callee.tools for h in _tool_holds(spec, known)}
    return sorted(found)


def _tool_holds(spec: ToolSpec, known: dict[str, Any]) -> Iterator[Hold]:
    for resource in spec.resources:
        kind, _, which = resource.partition(":")
        if which.startswith("{"):
            which = str(known.get(which.strip("{}"), "*"))
        yield Hold(f"{kind}:{which}" if which else kind, kind == CLOCK and spec.effect == "sense", spec.name)
    if CLOCK not in spec.resources and spec.effect != "pure":
        yield Hold(CLOCK, spec.effect == "sense", spec.name)


def clash(a: Hold, b: Hold) -> bool:
    """True when the two cannot be held at the same time. All that move share the clock, and so do all that sense."""
    if a.resource == b.resource == CLOCK:
        return a.shared != b.shared
    if a.shared and b.shared:
        return False
    kind, _, which = a.resource.partition(":")
    other_kind, _, other = b.resource.partition(":")
    return kind == other_kind and (which == other or "*" in (which, other))


def r1_r2_one_holder_at_a_time(sg: SubgraphContext) -> Iterator[Finding]:
    """R1: two nodes may hold one actuator at once. R2: one may move the robot while another senses."""
    held = {name: found for name in sg.nodes if (found := holds(sg, name))}
    names = list(held)
    for i, a in enumerate(names):
        others = (b for b in names[i:] if (a != b or a in sg.copied) and sg.parallel.may_overlap(a, b))
        pairs = (finding for b in others for finding in _pair(sg, a, b, held[a], held[b]))
        yield from islice(pairs, MAX_PER_NODE)


def _pair(sg: SubgraphContext, a: str, b: str, ours: list[Hold], theirs: list[Hold]) -> Iterator[Finding]:
    clashes = [(x, y) for x in ours for y in theirs if clash(x, y)]
    actuators = [c for c in clashes if CLOCK not in (c[0].resource, c[1].resource)]
    beside = f"beside {b!r}" if a != b else "in copies"
    hint = f'Add add_edge("{a}", "{b}").' if a != b else "Collect the items and act on them in one node."
    if actuators:
        x, y = actuators[0]
        which = x.resource if "*" not in x.resource else y.resource
        message = f"may hold {which} ({x.tool}) while it runs {beside} ({y.tool})"
        yield sg.finding("R1", f"nodes.{a}", message, hint)
    elif clashes and not {a, b} & sg.streaming:
        x, y = clashes[0]
        message = f"runs {beside}: {x.tool} and {y.tool} in no order, so what they do and see would depend on timing"
        yield sg.finding("R2", f"nodes.{a}", message, hint)


def r3_loops(sg: SubgraphContext) -> Iterator[Finding]:
    """R3: a loop has one way in, a way out, and starts over only when all that began in it has finished."""
    flow = sg.flow
    if not flow.back:
        return
    heads = {flow.arcs[n].target for n in flow.back}
    for node in sorted(heads & sg.must.endless):
        name = flow.names[node]
        hint = "Let a node of it choose with conditional edges between going round and going on."
        yield sg.finding("R3", f"nodes.{name}", f"the loop that begins at {name!r} never ends", hint)
    streaming = frozenset(flow.index[n] for n in sg.streaming)
    for number in sorted(flow.back):
        arc = flow.arcs[number]
        source, target = flow.names[arc.source], flow.names[arc.target]
        if number in flow.irreducible:
            message = f"the loop from {source!r} back to {target!r} can also be entered in its middle"
            yield sg.finding("R3", f"nodes.{target}", message, "Give the loop one first node.")
            continue
        running = sg.parallel.restarted_under(number, streaming)
        if running == 1:
            message = f"goes back to {target!r} though the same pass may lead to END"
            yield sg.finding("R3", f"nodes.{source}", message, "Choose one of the two with conditional edges.")
        elif running is not None:
            other = flow.names[running]
            message = f"goes back to {target!r} while {other!r} may still run"
            yield sg.finding("R3", f"nodes.{source}", message, f'Join first: add_edge("{other}", "{source}").')


def r4_one_end_per_pass(sg: SubgraphContext) -> Iterator[Finding]:
    """R4: two branches both reach END, so that the exit would depend on timing."""
    flow = sg.flow
    for a, b in sg.parallel.both_end():
        first, second = sorted((flow.names[a], flow.names[b]))
        hint = "Join the branches in one node before the exit."
        yield sg.finding("R4", f"nodes.{first}", f"and {second!r} can both end the same pass", hint)


def r1_r2_subgraphs_side_by_side(context: WorkflowContext) -> Iterator[Finding]:
    """R1: two subgraphs may hold one actuator at once. R2: one may move the robot while the other senses."""
    if not context.exit_flow.forks:
        return
    nodes = dict(context.subgraph_nodes())
    held = {name: _held(sg) for name, sg in nodes.items()}
    for a, b in combinations(nodes, 2):
        if held[a] and held[b] and context.exit_flow.parallel.may_overlap(a, b):
            yield from _subgraph_pair(a, b, held[a], held[b])


def _held(sg: SubgraphContext) -> list[tuple[Hold, str]]:
    """Everything a subgraph may hold, each by the first node that does; what streams shares the clock with anyone."""
    found: dict[Hold, str] = {}
    for name in sg.nodes:
        for hold in holds(sg, name):
            if not (hold.resource == CLOCK and name in sg.streaming):
                found.setdefault(hold, name)
    return sorted(found.items())


def _subgraph_pair(a: str, b: str, ours: list[tuple[Hold, str]], theirs: list[tuple[Hold, str]]) -> Iterator[Finding]:
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


RULES = (r1_r2_one_holder_at_a_time, r3_loops, r4_one_end_per_pass)
TOP_RULES = (r1_r2_subgraphs_side_by_side, r3_loops_beside_branches, r4_one_success_end)
