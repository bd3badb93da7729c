"""Places the boxes of a directed graph in layers and routes its links between them (Sugiyama's method).

Longest-path layering, barycentre ordering (Sugiyama, Tagawa and Toda 1981), and horizontal positions by isotonic
regression: as close to one's neighbours as the order within a layer allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import networkx as nx
import numpy as np
from scipy.optimize import isotonic_regression

Link = tuple[str, str]
Point = tuple[float, float]
GAP_X, GAP_Y = 26.0, 34.0  # px between boxes of a layer, and between layers
SWEEPS = 8


@dataclass(frozen=True)
class Placed:
    """A box: its top left corner and its size [px]."""

    x: float
    y: float
    width: float
    height: float

    @property
    def top(self) -> Point:
        """Where links enter."""
        return self.x + self.width / 2, self.y

    @property
    def bottom(self) -> Point:
        """Where links leave."""
        return self.x + self.width / 2, self.y + self.height


@dataclass(frozen=True)
class Drawing:
    """Boxes by name, the points each link runs through from source to target, and the size of it all [px]."""

    boxes: Mapping[str, Placed]
    routes: Mapping[Link, tuple[Point, ...]]
    width: float
    height: float


def lay_out(sizes: Mapping[str, tuple[float, float]], links: Sequence[Link]) -> Drawing:
    """Place boxes of the given (width, height). The same input gives the same drawing."""
    links = [link for link in dict.fromkeys(links) if set(link) <= sizes.keys() and link[0] != link[1]]
    graph = nx.DiGraph()
    graph.add_nodes_from(sizes)
    graph.add_edges_from(links)
    back = _back_links(graph)
    forward = {link: (link[::-1] if link in back else link) for link in links}
    graph.remove_edges_from(back)
    graph.add_edges_from(forward.values())
    rank = {name: i for i, layer in enumerate(nx.topological_generations(graph)) for name in layer}
    chains = {link: _chain(link, rank) for link in set(forward.values())}
    all_sizes = dict(sizes) | {n: (4.0, 0.0) for chain in chains.values() for n in chain[1:-1]}
    steps = [pair for chain in sorted(chains.values()) for pair in pairwise(chain)]
    for chain in chains.values():
        rank |= {name: rank[chain[0]] + i for i, name in enumerate(chain)}
    rows = _ordered(all_sizes, rank, steps)
    centres = _centres(rows, all_sizes, steps)
    return _drawing(sizes, all_sizes, rows, centres, {link: chains[forward[link]] for link in links}, back)


def _back_links(graph: nx.DiGraph) -> set[Link]:
    """Links that close a cycle on the walk from the first node."""
    inside: set[str] = set()
    back: set[Link] = set()
    for a, b, step in nx.dfs_labeled_edges(graph):
        if step == "forward":
            inside.add(b)
        elif step == "reverse":
            inside.discard(b)
        elif b in inside:
            back.add((a, b))
    return back


def _chain(link: Link, rank: Mapping[str, int]) -> tuple[str, ...]:
    a, b = link
    between = (f"\0{a}\0{b}\0{i}" for i in range(rank[a] + 1, rank[b]))
    return (a, *between, b)


def _ordered(names: Mapping[str, object], rank: Mapping[str, int], steps: Sequence[Link]) -> list[list[str]]:
    """Names by layer; sweeps up and down put each near its neighbours in the layer before."""
    rows: list[list[str]] = [[] for _ in range(max(rank.values(), default=-1) + 1)]
    for name in names:
        rows[rank[name]].append(name)
    beside = _neighbours(names, steps)
    for sweep in range(SWEEPS):
        down = sweep % 2 == 0
        order = rows[1:] if down else rows[-2::-1]
        for row in order:
            fixed = rows[rank[row[0]] + (-1 if down else 1)]
            place = {n: i for i, n in enumerate(fixed)}
            now = {n: i for i, n in enumerate(row)}
            near = {n: [place[o] for o in beside[n] if o in place] for n in row}
            row.sort(key=lambda n: sum(near[n]) / len(near[n]) if near[n] else now[n])
    return rows


def _neighbours(names: Iterable[str], steps: Sequence[Link]) -> dict[str, list[str]]:
    near: dict[str, list[str]] = {name: [] for name in names}
    for a, b in steps:
        near[a].append(b)
        near[b].append(a)
    return near


def _centres(
    rows: Sequence[Sequence[str]], sizes: Mapping[str, tuple[float, float]], steps: Sequence[Link]
) -> dict[str, float]:
    centres: dict[str, float] = {}
    beside = _neighbours(sizes, steps)
    for row in rows:
        x = 0.0
        for name in row:
            centres[name] = x + sizes[name][0] / 2
            x += sizes[name][0] + GAP_X
    for _ in range(SWEEPS):
        for row in rows:
            wanted = [np.mean([centres[o] for o in beside[n]] or [centres[n]]) for n in row]
            offsets = np.cumsum([0.0] + [(sizes[a][0] + sizes[b][0]) / 2 + GAP_X for a, b in pairwise(row)])
            fitted = isotonic_regression(np.array(wanted) - offsets).x + offsets
            centres |= {name: float(x) for name, x in zip(row, fitted, strict=True)}
    left = min((centres[n] - sizes[n][0] / 2 for row in rows for n in row), default=0.0)
    return {name: x - left for name, x in centres.items()}


def _drawing(
    sizes: Mapping[str, tuple[float, float]],
    all_sizes: Mapping[str, tuple[float, float]],
    rows: Sequence[Sequence[str]],
    centres: Mapping[str, float],
    chains: Mapping[Link, tuple[str, ...]],
    back: set[Link],
) -> Drawing:
    placed: dict[str, Placed] = {}
    y = 0.0
    for row in rows:
        tall = max((all_sizes[n][1] for n in row), default=0.0)
        for name in row:
            width, height = all_sizes[name][0], all_sizes[name][1] if name in sizes else tall
            placed[name] = Placed(centres[name] - width / 2, y + (tall - height) / 2, width, height)
        y += tall + GAP_Y
    routes = {}
    for link, chain in chains.items():
        between = [point for name in chain[1:-1] for point in (placed[name].top, placed[name].bottom)]
        points = (placed[chain[0]].bottom, *between, placed[chain[-1]].top)
        routes[link] = points[::-1] if link in back else points
    width = max((b.x + b.width for b in placed.values()), default=0.0)
    return Drawing({n: placed[n] for n in sizes}, routes, width, max(0.0, y - GAP_Y))
