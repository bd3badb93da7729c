"""What the flow analysis says holds in every schedule, and nothing it says is impossible happens in one."""

from __future__ import annotations

from itertools import combinations

from hypothesis import event, given, settings
from hypothesis import strategies as st

from gap_cli.analysis.concurrency import MayHappenInParallel
from gap_cli.analysis.must_execute import MustExecute
from gap_runtime.graph.control_flow import ControlFlowGraph
from gap_runtime.graph.model import Routing
from tests.unit.run.schedules import explore


def make(names, edges, routing=None, fan_out=()):
    routes = {n: Routing(router_field="x", mapping=m) for n, m in (routing or {}).items()}
    return ControlFlowGraph(names, edges, routes, frozenset(fan_out))


def pairs(text):
    """`START>a a>b b>END` as edges."""
    return [tuple(edge.split(">")) for edge in text.split()]


DIAMOND = make("abcd", pairs("START>a a>b a>c b>d c>d d>END"))
CHOICE = make("abcd", pairs("START>a b>d c>d d>END"), {"a": {"x": "b", "y": "c"}})
LOOP = make("abc", pairs("START>a a>b c>END"), {"b": {"again": "a", "on": "c"}})


def test_a_join_follows_every_branch():
    assert all(MustExecute(DIAMOND).before("d", n) for n in "abc")
    assert MayHappenInParallel(DIAMOND).may_overlap("b", "c")
    assert not MayHappenInParallel(DIAMOND).may_overlap("b", "d")


def test_of_a_choice_no_branch_is_sure_and_none_run_together():
    assert MustExecute(CHOICE).before("d", "a")
    assert not MustExecute(CHOICE).before("d", "b")
    assert not MayHappenInParallel(CHOICE).may_overlap("b", "c")


def test_after_a_loop_its_body_has_run_and_inside_it_what_follows_has_not():
    assert MustExecute(LOOP).before("c", "b")
    assert not MustExecute(LOOP).before("a", "b")
    assert LOOP.loops == {LOOP.index["a"]: 1 << LOOP.index["a"] | 1 << LOOP.index["b"]}


def test_a_branch_with_a_loop_is_joined_all_the_same():
    flow = make("abclz", pairs("START>a START>l l>b c>z a>z z>END"), {"b": {"again": "l", "on": "c"}})
    assert MustExecute(flow).before("z", "c") and MustExecute(flow).before("z", "a")


def test_what_runs_beside_is_not_before():
    flow = make("ab", pairs("START>a START>b a>END b>END"))
    assert not MustExecute(flow).before("a", "b")
    assert MayHappenInParallel(flow).both_end()


def test_a_stream_is_there_once_it_was_surely_started():
    flow = make("sab", pairs("START>s START>a a>b b>END"))
    assert MustExecute(flow).started_before("a", "s") and MustExecute(flow).started_before("b", "s")
    late = make("sab", pairs("START>a a>s a>b b>END"))
    assert MustExecute(late).started_before("b", "s") and not MustExecute(late).started_before("a", "s")
    maybe = make("sab", pairs("START>a b>END"), {"a": {"x": "s", "y": "b"}})
    assert not MustExecute(maybe).started_before("b", "s")


def test_a_join_waits_for_a_node_that_only_leads_back():
    flow = make("altz", pairs("START>a START>l t>l a>z z>END"), {"l": {"again": "t", "on": "z"}})
    assert not MayHappenInParallel(flow).may_overlap("t", "z") and not MayHappenInParallel(flow).may_overlap("l", "z")
    assert all(MayHappenInParallel(flow).restarted_under(n, frozenset()) is None for n in flow.back)
    assert MayHappenInParallel(flow).may_overlap("t", "a")


def test_of_two_ways_one_was_taken():
    assert MustExecute(CHOICE).one_before("d", "bc") and not MustExecute(CHOICE).one_before("d", "b")
    assert not MustExecute(CHOICE).one_before("b", "cd")
    assert not MustExecute(CHOICE).one_before("a", "bc")


def test_a_loop_with_two_ways_in_is_no_loop():
    flow = make("abc", pairs("START>a START>b a>b c>END"), {"b": {"x": "a", "y": "c"}})
    assert len(flow.irreducible) == 1 and not flow.loops


@st.composite
def graphs(draw, cyclic):
    """A random graph of up to six nodes in which everything is reached and leads on."""
    count = draw(st.integers(1, 6))
    names = "abcdef"[:count]
    edges, routing = [("START", names[0])], {}
    for i, name in enumerate(names):
        later = [*names[i + 1 :], "END"]
        anywhere = [*names, "END"] if cyclic else later
        if draw(st.booleans()):
            edges += [(name, t) for t in draw(st.lists(st.sampled_from(later), min_size=1, max_size=3, unique=True))]
        else:
            targets = (
                draw(st.lists(st.sampled_from(anywhere), min_size=2, max_size=3, unique=True))
                if len(anywhere) > 1
                else ["END"]
            )
            routing[name] = {str(k): t for k, t in enumerate(targets)}
            if draw(st.integers(0, 4)) == 0:
                edges.append((name, draw(st.sampled_from(later))))
    extra = draw(st.lists(st.sampled_from(names), max_size=2, unique=True))
    edges += [("START", n) for n in extra if n != names[0]]
    fan_out = draw(st.sets(st.sampled_from(sorted(routing)), max_size=1)) if routing else set()
    return names, list(dict.fromkeys(edges)), routing, fan_out


def judged(graph):
    names, edges, routing, fan_out = graph
    flow = make(names, edges, routing, fan_out)
    beside = MayHappenInParallel(flow)
    waits = {
        n: {flow.names[i] for i in range(len(flow.names)) if flow.before.get(flow.index[n], 0) >> i & 1} for n in names
    }
    return flow, beside, explore(names, edges, routing, waits, fan_out)


def pairs_of(names):
    """Every node with every pair of others."""
    return [(n, frozenset(p)) for n in names for p in combinations([m for m in names if m != n], 2)]


@settings(max_examples=120, deadline=None)
@given(graphs(cyclic=False))
def test_without_loops_the_analysis_is_exact(graph):
    flow, beside, seen = judged(graph)
    for n, group in pairs_of(graph[0]):
        sure = all(group & done for m, done in seen.finished if m == n)
        assert not MustExecute(flow).one_before(n, group) or sure, (n, group)
        event(f"one of two: {'exact' if MustExecute(flow).one_before(n, group) == sure else 'careful'}")
    for n in seen.started:
        for o in graph[0]:
            sure = (n, o) not in seen.missing
            assert MustExecute(flow).before(n, o) == sure, (n, o)
            if n != o:
                assert beside.may_overlap(n, o) == (frozenset((n, o)) in seen.overlaps), (n, o)
    assert {n for n in graph[0] if flow.index[n] in flow.rank} == seen.started
    assert not seen.stuck
    assert bool(beside.both_end()) == (seen.endings > 1)


@settings(max_examples=200, deadline=None)
@given(graphs(cyclic=True))
def test_with_loops_it_never_promises_what_may_not_be(graph):
    flow, beside, seen = judged(graph)
    restarted = [n for n in flow.back if beside.restarted_under(n, frozenset()) is not None]
    unsound = flow.irreducible or restarted or beside.both_end() or MustExecute(flow).endless
    event("refused" if unsound else "loops" if flow.back else "no loops")
    if unsound:
        return
    assert not seen.restarts and not seen.stuck and seen.endings == 1
    for n, group in pairs_of(graph[0]):
        if MustExecute(flow).one_before(n, group):
            assert all(group & done for m, done in seen.finished if m == n), (n, group)
    for n in seen.started:
        for o in graph[0]:
            assert not (MustExecute(flow).before(n, o) and (n, o) in seen.missing), (n, o)
            if n != o:
                assert beside.may_overlap(n, o) or frozenset((n, o)) not in seen.overlaps, (n, o)


def test_what_every_way_out_of_a_loop_passes_is_sure_after_it_and_only_there():
    edges = pairs("START>f f>k f>h c>d e>z k>z z>END")
    flow = make("fkhcdez", edges, {"h": {"on": "c", "again": "h"}, "d": {"on": "e", "again": "h"}})
    assert MustExecute(flow).before("z", "c")
    first = make("hpqc", pairs("START>h p>c q>c"), {"h": {"0": "p", "1": "q"}, "c": {"0": "h", "1": "p"}})
    assert not MustExecute(first).before("c", "p")
