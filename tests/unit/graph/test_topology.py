"""Who waits for whom."""

from __future__ import annotations

import itertools

import pytest

from gap_runtime.contracts.failures import UnknownNameError
from gap_runtime.graph.model import Routing
from gap_runtime.graph.topology import make_topology


def waits(topology, name):
    mask = topology.waits_for[topology.index[name]]
    return {n for n, i in topology.index.items() if mask >> i & 1}


def test_only_a_join_waits_and_for_all_that_can_reach_it():
    edges = [("START", "a"), ("a", "b"), ("a", "c"), ("c", "d"), ("b", "join"), ("d", "join"), ("join", "END")]
    topology = make_topology(["a", "b", "c", "d", "join"], edges, {}, "x")
    assert waits(topology, "join") == {"a", "b", "c", "d"}
    assert not waits(topology, "d")
    assert topology.ends == {topology.index["join"]}


def test_an_entry_with_another_way_in_is_a_join():
    topology = make_topology(["a", "b"], [("START", "a"), ("START", "b"), ("b", "a")], {}, "x")
    assert waits(topology, "a") == {"b"}


def test_conditional_targets_count_as_ways_in():
    routing = {"a": Routing(router_field="ok", mapping={"true": "join", "false": "b"})}
    topology = make_topology(["a", "b", "join"], [("START", "a"), ("b", "join")], routing, "x")
    assert waits(topology, "join") == {"a", "b"}


def test_what_can_run_again_is_known_and_a_chain_cannot():
    routing = {"b": Routing(router_field="again", mapping={"true": "a", "false": "c"})}
    topology = make_topology(["a", "b", "c", "d"], [("START", "a"), ("a", "b"), ("c", "d"), ("d", "END")], routing, "x")
    assert {topology.names[i] for i in topology.looped} == {"a", "b"}


def test_two_joins_of_one_loop_do_not_wait_for_each_other():
    edges = [
        ("START", "h"),
        ("h", "p"),
        ("h", "q"),
        ("p", "j"),
        ("q", "j"),
        ("p", "k"),
        ("q", "k"),
        ("j", "c"),
        ("k", "c"),
    ]
    routing = {"c": Routing(router_field="again", mapping={"true": "h", "false": "END"})}
    topology = make_topology(["h", "p", "q", "j", "k", "c"], edges, routing, "x")
    assert waits(topology, "j") == waits(topology, "k") == {"h", "p", "q"}
    assert not waits(topology, "h")


def test_a_join_waits_for_all_of_a_loop_in_one_of_its_branches():
    routing = {"l": Routing(router_field="again", mapping={"true": "t", "false": "z"})}
    topology = make_topology(
        ["a", "l", "t", "z"], [("START", "a"), ("START", "l"), ("t", "l"), ("a", "z")], routing, "x"
    )
    assert waits(topology, "z") == {"a", "l", "t"}
    assert waits(topology, "l") == set()


def test_order_of_declaration_does_not_matter():
    edges = [("START", "a"), ("a", "b"), ("b", "END")]
    assert make_topology(["a", "b"], edges, {}, "x") == make_topology(["b", "a"], edges[::-1], {}, "x")


def test_an_edge_to_nowhere_names_the_nearest_node():
    with pytest.raises(UnknownNameError, match="grasp"):
        make_topology(["grasp"], [("START", "grsp")], {}, "x")


def test_a_long_chain_waits_for_nobody_and_a_wide_join_for_all():
    names = [f"n{i}" for i in range(5000)]
    chain = make_topology(names, [("START", "n0"), *itertools.pairwise(names)], {}, "x")
    assert not any(chain.waits_for)
    wide = make_topology([*names, "z"], [e for n in names for e in (("START", n), (n, "z"))], {}, "x")
    assert wide.waits_for[-1].bit_count() == 5000
