"""A workflow as Mermaid flowchart text, for Markdown, issues and documentation."""

from __future__ import annotations

import re

from gap_cli.analysis.exit_flow import top_links
from gap_runtime.graph.model import END, START, Node, SubgraphDef, Workflow

SHAPES = {"noop": ('(["', '"])'), "router": ('{"', '"}'), "end": ('(("', '"))')}
STYLES = (
    "classDef actuate stroke-width:2px",
    "classDef streaming stroke-dasharray:5 3",
    "classDef success fill:#d9f2e3,stroke:#1f8a5b,color:#123",
    "classDef failure fill:#fbe3df,stroke:#c0392b,color:#123",
)


def mermaid(workflow: Workflow) -> str:
    """The whole graph: a box per subgraph with its nodes inside, exits as labels on the links between them."""
    lines = ["flowchart TD"]
    for name in sorted(workflow.nodes):
        node = workflow.nodes[name]
        definition = workflow.subgraphs.get(node.ref or "")
        if definition is not None:
            lines += _subgraph(name, definition)
        else:
            lines.append(f"  {_id(name)}{_box(name, node)}:::{node.status or 'failure'}")
    for (a, b), exits in sorted(top_links(workflow).items()):
        source = "START((start))" if a == START else _id(a)
        lines += [f"  {source} -->|{_text(value)}| {_id(b)}" for value in exits] or [f"  {source} --> {_id(b)}"]
    return "\n".join([*lines, *(f"  {style}" for style in STYLES)]) + "\n"


def _subgraph(name: str, definition: SubgraphDef) -> list[str]:
    lines = [f'  subgraph {_id(name)}["{_text(name)} ({_text(definition.skill)})"]']
    for inner in sorted(definition.nodes):
        node = definition.nodes[inner]
        css = ":::streaming" if node.streaming else ""
        lines.append(f"    {_id(name, inner)}{_box(inner, node)}{css}")
    for a, b in definition.edges:
        if a != START and b != END:
            lines.append(f"    {_id(name, a)} --> {_id(name, b)}")
    for a, routing in sorted(definition.conditional_edges.items()):
        for value, b in routing.mapping.items():
            if b not in (START, END):
                lines.append(f"    {_id(name, a)} -->|{_text(value)}| {_id(name, b)}")
    return [*lines, "  end"]


def _box(name: str, node: Node) -> str:
    left, right = SHAPES.get(node.type, ('["', '"]'))
    what = node.tool or (node.script or "").rpartition("/")[2]
    return f"{left}{_text(name)}{f'<br/><small>{_text(what)}</small>' if what else ''}{right}"


def _id(*names: str) -> str:
    """An identifier Mermaid accepts: its own words (`end`, `graph`, ...) cannot appear, because of the prefix."""
    return "n_" + "__".join(re.sub(r"\W", lambda m: f"_{ord(m[0]):x}_", name) for name in names)


def _text(text: str) -> str:
    return "".join(c if c.isalnum() or c in " ._-:/()" else f"#{ord(c)};" for c in text)
