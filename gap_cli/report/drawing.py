"""The graph as inline SVG: one box per subgraph with its nodes and how it did, exits along the edges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from typing import Any

from gap_cli.graph.model import START, Node, Workflow
from gap_cli.report.layout import back_links, layers

CHAR, LINE = 7.4, 17.0  # px: of the monospace text inside a box
PAD, GAP_X, GAP_Y = 12.0, 46.0, 58.0
MIN_WIDTH = 96.0
GOOD, FAIR = 0.9, 0.5


@dataclass(frozen=True)
class Box:
    """One top-level node, placed [px]."""

    name: str
    css: str
    title: str
    note: str
    lines: tuple[str, ...]
    x: float
    y: float
    width: float
    height: float

    @property
    def top(self) -> tuple[float, float]:
        """Where edges enter."""
        return self.x + self.width / 2, self.y

    @property
    def bottom(self) -> tuple[float, float]:
        """Where edges leave."""
        return self.x + self.width / 2, self.y + self.height


def graph_svg(workflow: Workflow, subgraphs: Mapping[str, Mapping[str, Any]]) -> str:
    """The drawing. `subgraphs` maps a top-level node to its entry in summary.json, where there is one."""
    links = edges(workflow)
    aside = [name for name, node in workflow.nodes.items() if node.status == "failure"]
    names = [n for n in (START, *workflow.nodes) if n not in aside]
    main = [link for link in links if not set(link) & set(aside)]
    boxes = _place(workflow, subgraphs, layers(names, main), aside)
    back = back_links(names, main)
    width = max(b.x + b.width for b in boxes.values()) + 24
    height = max(b.y + b.height for b in boxes.values()) + 8
    paths = [_edge(boxes[a], boxes[b], label, b in aside, (a, b) in back) for (a, b), label in links.items()]
    arrow = '<marker id="arrow" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
    return (
        f'<svg class="graph" viewBox="0 0 {width:.0f} {height:.0f}" style="width:{width:.0f}px" role="img" '
        f'aria-label="the graph"><defs>{arrow}<path d="M0 0 8 4 0 8z"/></marker></defs>'
        + "".join(paths)
        + "".join(_box(b) for b in boxes.values())
        + "</svg>"
    )


def edges(workflow: Workflow) -> dict[tuple[str, str], str]:
    """Every top-level link with the exits that take it."""
    found: dict[tuple[str, str], list[str]] = {}
    for a, b in workflow.edges:
        found.setdefault((a, b), [])
    for a, routing in workflow.conditional_edges.items():
        for value, b in routing.mapping.items():
            found.setdefault((a, b), []).append(value)
    known = {START, *workflow.nodes}
    return {link: ", ".join(labels) for link, labels in found.items() if set(link) <= known}


def _place(
    workflow: Workflow, subgraphs: Mapping[str, Mapping[str, Any]], rows: list[list[str]], aside: list[str]
) -> dict[str, Box]:
    """Rows from top to bottom, each centred; what failures lead to stands aside, at the bottom right."""
    drafts = {n: _draft(n, workflow, subgraphs.get(n)) for n in (*(n for row in rows for n in row), *aside)}
    widths = [sum(drafts[n].width for n in row) + GAP_X * (len(row) - 1) for row in rows]
    middle, y = max(widths) / 2 + 8, 8.0
    placed: dict[str, Box] = {}
    for row, width in zip(rows, widths, strict=True):
        x = middle - width / 2
        for name in row:
            placed[name] = replace(drafts[name], x=x, y=y)
            x += drafts[name].width + GAP_X
        y += max(drafts[n].height for n in row) + GAP_Y
    bottom = y - GAP_Y
    right = max(b.x + b.width for b in placed.values()) + 2 * GAP_X
    for name in aside:
        placed[name] = replace(drafts[name], x=right, y=bottom - drafts[name].height)
        right += drafts[name].width + GAP_X
    return placed


def _draft(name: str, workflow: Workflow, stats: Mapping[str, Any] | None) -> Box:
    node = workflow.nodes.get(name)
    css, note, lines = _content(node, workflow, stats)
    title = name if name != START else "start"
    width = max(MIN_WIDTH, CHAR * max(len(t) for t in (title, note, *lines)) + 2 * PAD)
    rows = 1 + bool(note) + len(lines)
    return Box(name, css, title, note, lines, 0, 0, width, rows * LINE + 2 * PAD - 4)


def _content(
    node: Node | None, workflow: Workflow, stats: Mapping[str, Any] | None
) -> tuple[str, str, tuple[str, ...]]:
    if node is None:
        return "start", "", ()
    if node.type == "end":
        recovery = tuple(f"recover: {call.tool}" for call in node.recovery)
        return f"end {node.status or ''}", "", recovery
    definition = workflow.subgraphs.get(node.ref or "")
    if definition is None:
        return "subgraph", str(node.ref), ()
    lines = tuple(f"{n}  {_callee(d)}" for n, d in definition.nodes.items())
    css, note = "subgraph", definition.skill
    if stats is not None:
        rate = stats["validation"]
        css += " good" if rate["rate"] >= GOOD else " fair" if rate["rate"] >= FAIR else " poor"
        note += f"  {rate['passed']}/{rate['of']}"
    return css, note, lines


def _callee(node: Node) -> str:
    return node.tool or (node.script or "").rpartition("/")[2] or node.type


def _box(box: Box) -> str:
    cx, y = box.x + box.width / 2, box.y + PAD + 9
    text = [f'<text class="name" x="{cx:.1f}" y="{y:.1f}">{escape(box.title)}</text>']
    if box.note:
        y += LINE
        text.append(f'<text class="note" x="{cx:.1f}" y="{y:.1f}">{escape(box.note)}</text>')
    for line in box.lines:
        y += LINE
        node, _, callee = line.partition("  ")
        ink = f'<tspan class="id">{escape(node)}</tspan><tspan dx="{CHAR:.1f}">{escape(callee)}</tspan>'
        text.append(f'<text class="node" x="{box.x + PAD:.1f}" y="{y:.1f}">{ink}</text>')
    return (
        f'<g class="{escape(box.css)}"><rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="7"/>{"".join(text)}</g>'
    )


def _edge(a: Box, b: Box, label: str, fails: bool, back: bool) -> str:
    (x1, y1), (x2, y2) = a.bottom, b.top
    if fails:  # to the right, then down
        x1, y1 = a.x + a.width, a.y + a.height / 2
        path = f"M{x1:.1f} {y1:.1f} H{x2 - 24:.1f} Q{x2:.1f} {y1:.1f} {x2:.1f} {min(y1 + 24, y2):.1f} V{y2:.1f}"
        middle = x1 + 8 + CHAR * len(label) / 2, y1 - 6
    elif back:  # around the left side
        side = min(a.x, b.x) - 30
        path = f"M{x1:.1f} {y1:.1f} C{side:.1f} {y1 + 40:.1f} {side:.1f} {y2 - 40:.1f} {x2:.1f} {y2:.1f}"
        middle = side + 10, (y1 + y2) / 2
    else:
        bend = (y2 - y1) / 2
        path = f"M{x1:.1f} {y1:.1f} C{x1:.1f} {y1 + bend:.1f} {x2:.1f} {y2 - bend:.1f} {x2:.1f} {y2:.1f}"
        middle = x1 + (x2 - x1) * 0.3, y1 + (y2 - y1) * 0.4
    text = f'<text class="exit" x="{middle[0]:.1f}" y="{middle[1]:.1f}">{escape(label)}</text>' if label else ""
    css = "edge fails" if fails else "edge"
    return f'<path class="{css}" d="{path}" marker-end="url(#arrow)"/>{text}'
