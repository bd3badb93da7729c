"""Workflow v3: the JSON a graph is stored as. Frozen, unknown keys refused; meaning is checked by the rules."""

from __future__ import annotations

from typing import Any, Final, Literal

from pydantic import Field

from gap_runtime.contracts.models import Document

START, END = "START", "END"
VERSION: Final = 3
Edge = tuple[str, str]


class Call(Document):
    """A tool call of a recovery: flat tool name and literal inputs."""

    tool: str
    inputs: dict[str, Any] = {}


class Routing(Document):
    """Conditional edges of one source: the field that decides (None from a router) and value -> target."""

    router_field: str | None = None
    mapping: dict[str, str] = Field(min_length=1)


class Node(Document):
    """A node. Which of the optional keys belong to which type is rule W2's business.

    tool        `tool` is a flat catalogue name or an atomic skill; may be `streaming`.
    script      `script` is a path below scripts/ in the workflow folder; may be `streaming`.
    router      `script` returns a node name, or a list of {to, inputs}.
    noop        a named marker.
    subgraph    `ref` names a subgraph definition; top level only.
    end         `status` and `recovery`; top level only.
    """

    type: str
    tool: str | None = None
    script: str | None = None
    ref: str | None = None
    inputs: dict[str, Any] = {}
    streaming: bool = Field(default=False, strict=True)
    deadline_s: float | None = Field(default=None, gt=0, strict=True)
    status: Literal["success", "failure"] | None = None
    recovery: list[Call] = []
    max_visits: int | None = Field(default=None, ge=1, strict=True)
    description: str = ""


class Exit(Document):
    """How a subgraph says how it ended: by terminal node name (router_field None) or by a field of its output."""

    router_field: str | None = None
    success_values: list[str]


class SubgraphDef(Document):
    """One segment of the task, built from one skill.

    `names` substitutes names of the skill's contract: a role (`target` -> `target_2` turns `target_obb` into
    `target_2_obb`), the slot `name`, or a whole input or output name. `parameters` overrides the contract's defaults;
    nodes read them as {"$ref": "param.<parameter>"}. Where `on_error` is not given it is the failure exit of the skill.
    """

    skill: str
    description: str = ""
    stage: str | None = None
    inputs: dict[str, str] = {}
    outputs: dict[str, Any] = {}
    nodes: dict[str, Node] = {}
    edges: list[Edge] = []
    conditional_edges: dict[str, Routing] = {}
    exit: Exit
    on_error: str = ""
    names: dict[str, str] = {}
    parameters: dict[str, Any] = {}


class Workflow(Document):
    """The whole graph: subgraph and end nodes at the top, definitions below."""

    version: Literal[3] = VERSION
    meta: dict[str, str] = {}
    nodes: dict[str, Node]
    edges: list[Edge] = []
    conditional_edges: dict[str, Routing] = {}
    subgraphs: dict[str, SubgraphDef]
