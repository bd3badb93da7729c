"""Writes a workflow back as builder code, and finds the lines of builder code that wrote a workflow."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import yaml

from gap_cli.analysis.catalog import contract_names, infer_names
from gap_cli.builder.assemble import SPEC_FILE, Lines, subgraph_file
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.graph.checkpoints import Checkpoint
from gap_runtime.graph.model import END, START, Edge, Routing, SubgraphDef, Workflow
from gap_runtime.graph.references import KEY

_Composer: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the C one is ten times as fast, where it was built
_SG_HEAD = "from vos.builder import END, START, Ref, Subgraph\n"
_SPEC_HEAD = "from vos.builder import START, WorkflowSpec\nfrom vos.runtime.workflow import ServiceCall\n"
_PLACES = {
    "add_node": "nodes", "add_exit": "nodes", "add_subgraph_node": "nodes", "add_end": "nodes", "add_input": "inputs",
    "add_conditional_edges": "conditional_edges", "add_checkpoint": "checkpoints", "declare_subgraph": "subgraphs",
}  # fmt: skip


def subgraph_source(name: str, definition: SubgraphDef, checkpoints: Sequence[Checkpoint] = ()) -> str:
    """Builder code whose `sg.to_dict()` is this definition."""
    d = definition
    named = d.exit.router_field is None
    exits = [v for v in d.exit.success_values if named and v in d.nodes and d.nodes[v].type == "noop"]
    lines = [_SG_HEAD, _call("sg = Subgraph", name, skill=d.skill, description=d.description)]
    lines += [_call("sg.add_input", key, proto_type=kind) for key, kind in d.inputs.items()]
    for key, node in d.nodes.items():
        if key in exits:
            lines.append(_call("sg.add_exit", key))
        else:
            given = {k: v for k, v in node if k not in ("ref", "status", "recovery", "max_visits")}
            lines.append(_call("sg.add_node", key, **given))
    if not named:
        router = {"router_field": d.exit.router_field, "success_values": d.exit.success_values}
        lines.append(f"sg.set_exit_router({_keywords(router)})")
    lines += _edges("sg", d.edges, d.conditional_edges)
    lines += [f"sg.set_outputs({_keywords(d.outputs)})"] if d.outputs else []
    lines += [_call("sg.set_on_error", d.on_error)] if d.on_error else []
    for point in checkpoints:
        given = {k: v for k, v in point.as_dict().items() if k not in ("name", "predicate")}
        lines.append(_call("sg.add_checkpoint", point.name, point.predicate, **given))
    return "\n".join(lines) + "\n"


def spec_source(workflow: Workflow, skills: Mapping[str, SkillContract]) -> str:
    """Builder code whose `spec.to_dict()` is the topology of this workflow."""
    w = workflow
    known = {k: v for k, v in w.meta.items() if k not in ("name", "description")}
    head: dict[str, Any] = {"description": w.meta.get("description", ""), "meta": known}
    lines = [_SPEC_HEAD, _call("spec = WorkflowSpec", w.meta.get("name", ""), **head)]
    for name, d in w.subgraphs.items():
        given: dict[str, Any] = {
            "skill": d.skill,
            "description": d.description,
            "inputs": d.inputs,
            "outputs": _types(d, skills),
        }
        given |= {"exit_success_values": d.exit.success_values, "on_error": d.on_error, "stage": d.stage}
        given |= {"names": d.names, "parameters": d.parameters}
        lines.append(_call("spec.declare_subgraph", name, keep=("exit_success_values",), **given))
    for name, node in w.nodes.items():
        if node.type == "end":
            calls = ", ".join(f"ServiceCall({c.tool!r}, {_value(c.inputs)})" for c in node.recovery)
            recovery = f", recovery=[{calls}]" if calls else ""
            more = _keywords({"status": node.status, "description": node.description})
            lines.append(f"spec.add_end({name!r}, {more}{recovery})")
        else:
            given = {"ref": node.ref, "max_visits": node.max_visits, "description": node.description}
            lines.append(_call("spec.add_subgraph_node", name, **given))
    return "\n".join([*lines, *_edges("spec", w.edges, w.conditional_edges)]) + "\n"


def builder_lines(workflow: Workflow, sources: Mapping[str, str]) -> Lines:
    """Path in the workflow -> file and line of the builder code that wrote it. `sources` maps a file of the run
    (`plan/spec.py`, `generate/subgraphs/<name>.py`) to its text.

    Reads syntax only: what code in a loop added has no line here. Text that is not Python gives none.
    """
    lines = _lines(sources, SPEC_FILE, "", workflow.edges)
    for name, definition in workflow.subgraphs.items():
        lines |= _lines(sources, subgraph_file(name), f"subgraphs.{name}.", definition.edges)
    return lines


def workflow_lines(text: str, file: str) -> Lines:
    """Path in the workflow -> line of workflow.json that says it; none where the text is not the JSON that YAML reads
    too (the strict reader says what is wrong with it)."""
    try:
        return dict(_json_lines(yaml.compose(text, Loader=_Composer), "", file))
    except (yaml.YAMLError, RecursionError):
        return {}


def _json_lines(node: Any, path: str, file: str) -> Iterator[tuple[str, tuple[str, int]]]:
    pairs: Iterable[tuple[str, Any]] = ()
    if isinstance(node, yaml.MappingNode):
        pairs = [(str(key.value), value) for key, value in node.value]
        yield from ((f"{path}{key.value}", (file, key.start_mark.line + 1)) for key, _ in node.value)
    elif isinstance(node, yaml.SequenceNode):
        pairs = [(str(i), value) for i, value in enumerate(node.value)]
        yield from ((f"{path}{i}", (file, value.start_mark.line + 1)) for i, value in pairs)
    for key, value in pairs:
        yield from _json_lines(value, f"{path}{key}.", file)


def _lines(sources: Mapping[str, str], file: str, prefix: str, edges: Sequence[Edge]) -> Lines:
    try:
        tree = ast.parse(sources.get(file, ""))
    except (SyntaxError, ValueError, RecursionError):
        return {}
    return {prefix + place: (file, line) for place, line in _placed(tree, list(map(tuple, edges)))}


def _placed(tree: ast.Module, edges: list[tuple[str, ...]]) -> Iterator[tuple[str, int]]:
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        words = [_word(a) for a in node.args[:2]]
        if node.func.attr in _PLACES and words and words[0]:
            yield f"{_PLACES[node.func.attr]}.{words[0]}", node.lineno
        elif node.func.attr == "add_edge" and tuple(words) in edges:
            yield f"edges.{edges.index(tuple(map(str, words)))}", node.lineno
        elif node.func.attr == "set_outputs":
            yield from ((f"outputs.{k.arg}", node.lineno) for k in node.keywords if k.arg)
        elif node.func.attr in ("set_on_error", "set_exit_router"):
            yield "on_error" if node.func.attr == "set_on_error" else "exit", node.lineno


def _word(node: ast.expr) -> str | None:
    if isinstance(node, ast.Name) and node.id in (START, END):
        return node.id
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _types(definition: SubgraphDef, skills: Mapping[str, SkillContract]) -> dict[str, str]:
    """The outputs with the types the skill gives them; `any` where it does not say."""
    contract = skills.get(definition.skill.replace("_", "-"))
    if contract is None:
        return dict.fromkeys(definition.outputs, "any")
    names = infer_names(contract, definition.names, definition.outputs)
    known = contract_names(contract, names)[1]
    return {n: str(known[n]) if n in known else "any" for n in definition.outputs}


def _edges(owner: str, edges: Sequence[Edge], routing: Mapping[str, Routing]) -> Iterator[str]:
    for source, target in edges:
        yield f"{owner}.add_edge({_end(source)}, {_end(target)})"
    for source, routes in routing.items():
        field = f", router_field={routes.router_field!r}" if routes.router_field is not None else ""
        yield f"{owner}.add_conditional_edges({source!r}, {routes.mapping!r}{field})"


def _end(name: str) -> str:
    return name if name in (START, END) else repr(name)


def _call(function: str, *arguments: Any, keep: tuple[str, ...] = (), **keywords: Any) -> str:
    """A call with what says nothing left out, except for `keep` and a checkpoint's `validate=False`."""
    said = {
        k: v
        for k, v in keywords.items()
        if k in keep or (v is not None and v not in ("", [], {}) and (v is not False or k == "validate"))
    }
    return f"{function}({', '.join([*map(_value, arguments), *([_keywords(said)] if said else [])])})"


def _keywords(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{k}={_value(v)}" for k, v in values.items() if v is not None and v != "")


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        if set(value) == {KEY}:
            return f"Ref({value[KEY]!r})"
        return "{" + ", ".join(f"{k!r}: {_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return repr(value)
