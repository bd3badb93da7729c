"""K1-K7: a subgraph keeps to its skill's contract, and calls what exists."""

from __future__ import annotations

from collections.abc import Iterator

from gap_cli.analysis.catalog import Catalog
from gap_cli.analysis.context import SubgraphContext, WorkflowContext
from gap_cli.analysis.value_types import literal_problem
from gap_runtime.contracts.skill import check_relative
from gap_runtime.errors import Finding, did_you_mean
from gap_runtime.graph.model import Call
from gap_runtime.graph.references import references_in


def k1_skill(sg: SubgraphContext) -> Iterator[Finding]:
    """K1: the skill exists, and is one that subgraphs are made of."""
    d = sg.definition
    if sg.contract is None:
        known = {name: sg.catalog.descriptions.get(name, "") for name in sg.catalog.skills}
        hint = did_you_mean(d.skill.replace("_", "-"), known) if known else ""
        yield sg.finding("K1", "skill", f"there is no skill {d.skill!r}", hint or "No skills are installed.")
    elif sg.contract.kind == "atomic":
        hint = f'Call it from a node: type="tool", tool="{d.skill}".'
        yield sg.finding("K1", "skill", f"{d.skill} is atomic: a tool, not a subgraph", hint)


def k2_tools_exist(sg: SubgraphContext) -> Iterator[Finding]:
    """K2: the tool of a node exists."""
    for name, node in sg.nodes.items():
        if node.type == "tool" and node.tool is not None and sg.callees[name] is None:
            yield sg.finding("K2", f"nodes.{name}.tool", *_unknown_tool(sg.catalog, node.tool))


def _unknown_tool(catalog: Catalog, name: str) -> tuple[str, str]:
    known = {n: spec.summary for n, spec in catalog.tools.items()}
    known |= {n: catalog.descriptions.get(n, "") for n, contract in catalog.skills.items() if contract.kind == "atomic"}
    return f"there is no tool {name!r}", did_you_mean(name, known) if known else "No tools are installed."


def k2_recoveries(context: WorkflowContext) -> Iterator[Finding]:
    """K2, D6-D8 over the calls of a recovery, whose inputs are literals."""
    for name, node in context.workflow.nodes.items():
        for i, call in enumerate(node.recovery):
            yield from _recovery(context, f"nodes.{name}.recovery.{i}", call)


def _recovery(context: WorkflowContext, path: str, call: Call) -> Iterator[Finding]:
    spec = context.catalog.tools.get(call.tool)
    if spec is None:
        yield Finding(f"{path}.tool", "K2", *_unknown_tool(context.catalog, call.tool))
        return
    known = {p.name: p for p in spec.inputs}
    for parameter in known.values():
        if parameter.required and parameter.name not in call.inputs:
            yield Finding(path, "D7", f"tool {spec.name} needs {parameter.name!r} ({parameter.type})")
    for name, value in call.inputs.items():
        where = f"{path}.inputs.{name}"
        if name not in known:
            hint = did_you_mean(name, known) if known else "It takes none."
            yield Finding(where, "D8", f"tool {spec.name} has no input {name!r}", hint)
        elif any(references_in(value, "")):
            yield Finding(where, "D1", "a recovery has nothing to refer to", "Give a literal.")
        elif known[name].type.name != "any" and (problem := literal_problem(value, known[name].type)):
            yield Finding(where, "D6", f"does not fit {known[name].type}: {problem[0]}", problem[1])


def k3_scripts_exist(sg: SubgraphContext) -> Iterator[Finding]:
    """K3: the script of a node is below scripts/, is there, and can be read."""
    for name, node in sg.nodes.items():
        path = f"nodes.{name}.script"
        if node.type not in ("script", "router") or node.script is None:
            continue
        if node.script in sg.catalog.problems:
            yield sg.finding("K3", path, sg.catalog.problems[node.script])
        elif not _is_script_path(node.script):
            hint = f"Write scripts/{sg.name}/<file>.py."
            yield sg.finding("K3", path, f"{node.script!r} is not a script of this workflow", hint)
        elif node.script not in sg.catalog.scripts:
            known = sg.catalog.scripts
            hint = did_you_mean(node.script, known) if known else "Write it, or name a canonical script of the skill."
            yield sg.finding("K3", path, f"there is no {node.script}", hint)


def _is_script_path(path: str) -> bool:
    try:
        check_relative(path)
    except ValueError:
        return False
    return path.startswith("scripts/") and path.endswith(".py")


def k4_tools_of_the_skill(sg: SubgraphContext) -> Iterator[Finding]:
    """K4: a node, or a script by name, calls a tool outside the skill's list."""
    if sg.contract is None:
        return
    allowed = {t.replace("_", "-") if "." not in t else t for t in sg.contract.tools}
    skill = sg.definition.skill
    for name, node in sg.nodes.items():
        if node.type == "tool" and node.tool is not None and sg.callees[name] is not None:
            used, path = [node.tool], f"nodes.{name}.tool"
        elif node.script in sg.catalog.scripts:
            used, path = sorted(sg.catalog.scripts[str(node.script)].tools), f"nodes.{name}.script"
        else:
            continue
        for tool in used:
            if (tool if "." in tool else tool.replace("_", "-")) not in allowed:
                hint = did_you_mean(tool, allowed) if allowed else f"{skill} may call none."
                yield sg.finding("K4", path, f"{tool} is not among the tools of {skill}", hint)


def k5_exits_of_the_skill(sg: SubgraphContext) -> Iterator[Finding]:
    """K5: success values and on_error are the skill's."""
    if sg.contract is None or sg.contract.kind == "atomic":
        return
    d, exits = sg.definition, sg.contract.exits
    for value in d.exit.success_values:
        if value not in exits.success:
            hint = did_you_mean(value, exits.success)
            yield sg.finding("K5", "exit.success_values", f"{value!r} is not an exit of {d.skill}", hint)
    if d.on_error and d.on_error != exits.failure:
        message = f"on_error is {d.on_error!r}, and {d.skill} fails with {exits.failure!r}"
        yield sg.finding("K5", "on_error", message, f'Write sg.set_on_error("{exits.failure}").')


def k6_parameters(sg: SubgraphContext) -> Iterator[Finding]:
    """K6: parameters are the skill's and within bounds."""
    if sg.contract is None:
        return
    known = sg.contract.parameters
    for name, value in sg.definition.parameters.items():
        path = f"parameters.{name}"
        if name not in known:
            hint = did_you_mean(name, known) if known else "It has none."
            yield sg.finding("K6", path, f"{sg.definition.skill} has no parameter {name!r}", hint)
        elif problem := known[name].problem_with(value):
            yield sg.finding("K6", path, problem, f"The default is {known[name].default!r}.")


def k7_stage(sg: SubgraphContext) -> Iterator[Finding]:
    """K7: the stage tag is the skill's."""
    stage = sg.definition.stage
    if sg.contract is not None and stage is not None and stage != sg.contract.stage:
        right = sg.contract.stage
        hint = f'Write stage="{right}".' if right else "Drop it."
        yield sg.finding("K7", "stage", f"is {stage!r}, and {sg.definition.skill} is {right or 'of no stage'}", hint)


RULES = (
    k1_skill,
    k2_tools_exist,
    k3_scripts_exist,
    k4_tools_of_the_skill,
    k5_exits_of_the_skill,
    k6_parameters,
    k7_stage,
)
TOP_RULES = (k2_recoveries,)
