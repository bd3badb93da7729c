"""Proves that a skill keeps its contract: everything in its folder is read, rendered, run in the sandbox, validated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from pathlib import Path
from typing import Any

from gap_cli.analysis.catalog import SLOT, contract_names
from gap_cli.author.build import Generated, draft
from gap_cli.author.operators import literal_source
from gap_cli.author.plans import Plan, PlanData, Segment
from gap_cli.sandbox.script_check import check_scripts
from gap_cli.skills import SkillBundle, SkillLibrary
from gap_cli.skills.bundle import read_bundle
from gap_runtime.contracts.cell import Cell
from gap_runtime.contracts.documents import read_text
from gap_runtime.contracts.skill import NAME_SLOT, SkillContract
from gap_runtime.contracts.tool import Tool, ToolSpec
from gap_runtime.errors import Finding, GapError, WorkflowError, did_you_mean
from gap_runtime.graph.compile import compile_workflow
from gap_runtime.graph.scripts import read_signature
from gap_runtime.run.execute import RunResult, RunSetup, run_graph

CODE = "SKILL"
_ALONE = {"S13"}  # nothing precedes a skill that is tried alone, so nothing produces its inputs
_LITERALS: dict[str, Any] = {"string": "thing", "string[]": ["thing"], "float": 1.0, "int": 1, "bool": True}


def check_folder(path: Path, tools: Mapping[str, ToolSpec]) -> list[Finding]:
    """Every problem of the skill in a folder, of its files first; empty when it can be used in a graph."""
    bundle, errors = read_bundle(path)
    findings = [
        Finding(error.where.removeprefix(f"{path}/"), CODE, problem, error.hint)
        for error in errors
        for problem in error.problems
    ]
    if bundle is None:
        scripts = sorted(path.glob("scripts/*.py"))
        return [*findings, *_scripts({p.stem: p for p in scripts}, None)]
    return [*findings, *check_skill(bundle, tools)]


def check_skill(bundle: SkillBundle, tools: Mapping[str, ToolSpec]) -> list[Finding]:
    """Every problem of one skill, sorted; empty when it can be used in a graph.

    `tools` are those that are served; a skill whose tools are not is a finding too.
    """
    allowed = set(bundle.contract.tools)
    unknown = [name for name in bundle.contract.tools if name not in tools]
    findings = [Finding(f"tools.{n}", CODE, f"no plugin serves {n!r}", did_you_mean(n, tools)) for n in unknown]
    findings += _scripts(bundle.scripts, allowed)
    if bundle.contract.kind == "composite" and bundle.template:
        said = {f.message for f in findings}
        findings += [
            f for f in _subgraph(bundle, tools) if f.message not in said and not _repeats(f, unknown, findings)
        ]
    return sorted(findings)


def _repeats(finding: Finding, unknown: Sequence[str], findings: Sequence[Finding]) -> bool:
    """Whether a rule of the graph says again what was said of the contract's tools or of a script."""
    calls = any(f.path.startswith("scripts.") for f in findings) and ".script" in finding.path
    return finding.code in ("K2", "K4") and (calls or any(f"{n!r}" in finding.message for n in unknown))


def sample_plan(bundle: SkillBundle) -> tuple[Plan, dict[str, str]]:
    """A plan of this one skill over made-up objects, and the labels of those."""
    contract = bundle.contract
    roles = {role: f"some_{role}" for role in contract.roles}
    labels = {name: name.replace("_", " ") for name in roles.values()}
    slotted = any(n.startswith(NAME_SLOT) for n in (*contract.inputs, *contract.outputs))
    names = {SLOT: "thing"} if slotted else {}
    inputs, outputs = contract_names(contract, names)
    segment = Segment(
        name="sample",
        skill=bundle.name,
        stage=contract.stage,
        layer=0,
        roles=roles,
        names=names,
        literals={name: _literal(contract, name, labels, roles) for name in contract.literals},
        inputs={name: str(type_) for name, type_ in inputs.items()},
        outputs={name: str(type_) for name, type_ in outputs.items()},
        exits=list(contract.exits.success),
        on_error=contract.exits.failure,
    )
    content = PlanData(
        task="sample", instruction=f"Try {bundle.name}", author="proof", scene="none", segments=[segment]
    )
    return Plan.of(content), labels


def draft_alone(bundle: SkillBundle, tools: Mapping[str, ToolSpec]) -> Generated:
    """The graph of this one skill alone. Raises what generating raises."""
    plan, labels = sample_plan(bundle)
    return draft(plan, labels, SkillLibrary([bundle]), tools)


def _scripts(scripts: Mapping[str, Path], allowed: Set[str] | None) -> Iterator[Finding]:
    """What is wrong with scripts by logical name; `allowed` are the tools the contract lists, where it can be read."""
    texts: dict[str, str] = {}
    for logical, file in scripts.items():
        path = f"scripts.{logical}"
        try:
            text = read_text(file)
            spec = read_signature(text, str(file))
        except GapError as error:
            yield Finding(path, CODE, error.message, error.hint)
            continue
        for name in sorted(spec.tools - allowed) if allowed is not None else ():
            yield Finding(path, CODE, f"calls {name}, which the contract does not list", "Add it below tools:.")
        texts[logical] = text
    for p in check_scripts(texts):
        yield Finding(f"scripts.{p.file}", CODE, p.message, p.hint, file=str(scripts[p.file]), line=p.line)


def _subgraph(bundle: SkillBundle, tools: Mapping[str, ToolSpec]) -> list[Finding]:
    try:
        findings = draft_alone(bundle, tools).findings
    except WorkflowError as error:
        findings = list(error.findings)
    except GapError as error:
        findings = [Finding("template", CODE, error.message, error.hint)]
    return [f for f in findings if f.code not in _ALONE]


def _literal(contract: SkillContract, name: str, labels: Mapping[str, str], roles: Mapping[str, str]) -> Any:
    role, what = literal_source(contract, name) or ("", "")
    return labels[roles[role]] if what == "name" else _LITERALS.get(contract.literals[name], "thing")


def run_alone(bundle: SkillBundle, tools: Mapping[str, Tool], world: Cell, folder: Path) -> RunResult:
    """Run the graph of this one skill, which must take no inputs, in `world`; its scripts are written to `folder`.

    For tests of skills. Raises what generating raises, and `WorkflowError` for a graph the validator refuses.
    """
    made = draft_alone(bundle, {name: tool.spec for name, tool in tools.items()})
    if made.findings:
        raise WorkflowError(made.findings, what=f"The graph of {bundle.name}")
    for path, text in made.scripts.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    canonical = SkillLibrary([bundle]).canonical_scripts(made.workflow, folder)
    graph = compile_workflow(made.workflow, folder, tools, {bundle.name: bundle.contract}, canonical)
    return run_graph(graph, RunSetup(cell=world))
