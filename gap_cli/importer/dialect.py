"""The other dialect's builder, in terms of ours: read as text, put before foreign code, and run in the sandbox."""

from __future__ import annotations

from gap_cli.builder.workflow import Ref, ServiceCall, Subgraph, WorkflowSpec


class Workflow(WorkflowSpec):
    """A whole graph in one object: subgraphs are added, not declared."""

    def add_subgraph(self, subgraph: Subgraph) -> Workflow:
        """Keep a finished subgraph; `to_dict` writes it out."""
        self.subgraphs[subgraph.name] = subgraph.to_dict()
        return self

    def add_node(self, name: str, *, type: str, **keys: object) -> None:
        """A node of any kind, its keys unchecked: they are translated later."""
        self.put(name, {"type": type, **{key: plain(value) for key, value in keys.items()}}, name)

    def add_end(self, name: str, *, status: str, recovery: object = (), description: str = "") -> None:
        """An end, its recovery as data."""
        self.add_node(name, type="end", status=status, recovery=recovery, description=description)

    def to_dict(self) -> dict[str, object]:
        """`def` holds whole subgraphs, `checkpoints` those of all of them by subgraph."""
        parts = self.subgraphs
        definition = {"version": 3, "meta": self.meta, "nodes": self.nodes, "edges": self.edges}
        definition["conditional_edges"] = self.conditional_edges
        definition["subgraphs"] = {name: part["def"] for name, part in parts.items()}
        points = {name: part["checkpoints"] for name, part in parts.items()}
        return {"kind": "workflow", "name": self.name, "def": definition, "checkpoints": points}


def plain(value: object) -> object:
    """JSON data of references and recoveries."""
    if isinstance(value, Ref):
        return {"$ref": value.path}
    if isinstance(value, ServiceCall):
        return {"tool": value.tool, "inputs": value.inputs}
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value
