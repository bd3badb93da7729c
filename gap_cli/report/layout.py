"""Layers and columns for a small directed graph: where each node of a drawing goes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

Link = tuple[str, str]
SWEEPS = 4


def layers(nodes: Sequence[str], links: Sequence[Link]) -> list[list[str]]:
    """Nodes by longest path from the sources, links that lead back left out, each layer ordered to cross little."""
    forward = [link for link in links if link not in back_links(nodes, links)]
    rank = dict.fromkeys(nodes, 0)
    for _ in nodes:
        for a, b in forward:
            rank[b] = max(rank[b], rank[a] + 1)
    rows = [[n for n in nodes if rank[n] == r] for r in range(max(rank.values(), default=-1) + 1)]
    for _ in range(SWEEPS):
        for above, row in pairwise(rows):
            place = {n: i for i, n in enumerate(above)}
            row.sort(key=lambda n: _mean([place[a] for a, b in forward if b == n and a in place]))
    return rows


def back_links(nodes: Sequence[str], links: Sequence[Link]) -> set[Link]:
    """Links to a node that the walk from the first node is still inside of: those that close a loop."""
    after: dict[str, list[str]] = {n: [b for a, b in links if a == n] for n in nodes}
    back: set[Link] = set()
    done: set[str] = set()
    for start in nodes:
        stack = [(start, iter(after[start]))] if start not in done else []
        inside = {start}
        while stack:
            node, following = stack[-1]
            child = next(following, None)
            if child is None:
                stack.pop()
                inside.discard(node)
                done.add(node)
            elif child in inside:
                back.add((node, child))
            elif child not in done:
                inside.add(child)
                stack.append((child, iter(after[child])))
    return back


def _mean(places: Sequence[int]) -> float:
    return sum(places) / len(places) if places else 0.0
