"""Every schedule of a small graph, by exhaustion: what the analysis claims is checked against all that can be."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import chain, combinations


@dataclass
class Seen:
    """What happened in some schedule. Nodes are names."""

    missing: set = field(default_factory=set)  # (node, other): node started and other had not finished
    finished: set = field(default_factory=set)  # (node, nodes that had finished when it started)
    overlaps: set = field(default_factory=set)  # {a, b} ran at once
    started: set = field(default_factory=set)
    restarts: set = field(default_factory=set)  # a node was reached again while it ran or waited after it had run
    stuck: bool = False  # nodes wait for each other
    endings: int = 0  # most ENDs reached in one run


def explore(names, edges, routing, waits, fan_out=()):
    """All schedules: nodes start when nobody they wait for is due or running, and finish in any order."""
    seen, todo = Seen(), [(frozenset(), frozenset(b for a, b in edges if a == "START"), frozenset(), 0)]
    visited = set()
    while todo:
        state = todo.pop()
        if state in visited:
            continue
        visited.add(state)
        running, due, done, ended = state
        seen.endings = max(seen.endings, ended)
        ready = [n for n in due if not waits[n] & (running | due - {n})]
        if due and not ready and not running:
            seen.stuck = True
        for n in ready:
            seen.started.add(n)
            seen.finished.add((n, done))
            seen.missing |= {(n, o) for o in names if o not in done}
            seen.overlaps |= {frozenset((n, o)) for o in running}
            todo.append((running | {n}, due - {n}, done, ended))
        for n in running:
            for targets in outcomes(n, edges, routing, fan_out):
                reached = set(targets) - {"END"}
                if reached & (running - {n}):
                    seen.restarts |= reached & running
                    continue
                count = min(2, ended + targets.count("END"))
                todo.append((running - {n}, due | reached, done | {n}, count))
    return seen


def outcomes(node, edges, routing, fan_out):
    """The lists of targets control may go to from a node."""
    always = [b for a, b in edges if a == node]
    routes = sorted(set(routing.get(node, {}).values()))
    if not routes:
        return [always]
    if node in fan_out:
        sets = chain.from_iterable(combinations(routes, k) for k in range(1, len(routes) + 1))
        return [always + [t for t in some if t not in always] for some in sets]
    return [always + [t] * (t not in always) for t in routes]
