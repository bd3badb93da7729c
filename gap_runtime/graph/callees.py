"""Makes callees: tools as registered, trusted scripts loaded in process, and scripts for the jail."""

from __future__ import annotations

import hashlib
import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from gap_runtime.contracts.access import Effect
from gap_runtime.contracts.failures import DocumentError, GapError, did_you_mean
from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.tool import Param, Tool
from gap_runtime.graph.compiled import SCRIPT_DEADLINE_S, BoundCallable
from gap_runtime.graph.scripts import ScriptSpec
from gap_runtime.graph.values import Check, make_check, make_result_check

_RANK: dict[Effect, int] = {"pure": 0, "sense": 1, "actuate": 2}


def tool_callee(tool: Tool) -> BoundCallable:
    """A registered tool."""
    spec = tool.spec
    return BoundCallable(
        spec.name, "tool", spec.inputs, _checks(spec.inputs), _required(spec.inputs), spec.output, spec.fields,
        make_result_check(spec.name.replace(".", "_"), spec.output, spec.fields), spec.effect, spec.resources,
        spec.deadline_s, tool.takes_context, tool.call, privileged=spec.privileged, streaming=spec.streaming,
    )  # fmt: skip


def script_callee(
    name: str,
    spec: ScriptSpec,
    file: Path,
    allowed: frozenset[str],
    tools: Mapping[str, BoundCallable],
    *,
    trusted: bool,
) -> BoundCallable:
    """A script: in process where `trusted`, else for the jail. Raises `DocumentError` when it cannot be loaded."""
    run = load_script(file) if trusted else None

    def invoke(ctx: Any, kwargs: dict[str, Any]) -> Any:
        return ctx.run_jailed(file, kwargs) if run is None else run(ctx, **kwargs)

    return BoundCallable(
        name, "script", spec.inputs, _checks(spec.inputs), _required(spec.inputs), spec.output, spec.fields,
        make_result_check(name, spec.output, spec.fields), _effect(spec, allowed, tools), (), SCRIPT_DEADLINE_S, True,
        invoke, allowed=allowed, choices=spec.choices, streaming=spec.publishes, jailed=not trusted,
    )  # fmt: skip


def load_script(file: Path) -> Callable[..., Any]:
    """The `run` of a trusted script, imported under a name of its own."""
    name = f"gap_script_{hashlib.sha256(str(file).encode()).hexdigest()[:16]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise DocumentError(str(file), "is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses and NamedTuples look their module up
    try:
        spec.loader.exec_module(module)
    except GapError:
        raise
    except Exception as error:
        raise DocumentError(str(file), f"cannot be loaded: {type(error).__name__}: {error}") from error
    run = getattr(module, "run", None)
    if not callable(run):
        raise DocumentError(str(file), "has no function run", hint="Write def run(ctx, ...) -> ...:")
    return run  # type: ignore[no-any-return]


def find_skill(skills: Mapping[str, SkillContract], name: str) -> tuple[str, SkillContract] | None:
    """A skill by its kebab name or the underscore spelling of it."""
    for spelling in (name, name.replace("_", "-")):
        if spelling in skills:
            return spelling, skills[spelling]
    return None


def unknown_input(callee: BoundCallable, name: str) -> GapError:
    """The error for an input a callee does not have."""
    known = [p.name for p in callee.arguments]
    return DocumentError(callee.name, f"has no input {name!r}", hint=did_you_mean(name, known))


def _effect(spec: ScriptSpec, allowed: Iterable[str], tools: Mapping[str, BoundCallable]) -> Effect:
    names = allowed if spec.any_tool else spec.tools
    effects = [tools[n].effect for n in names if n in tools]
    return max(effects, key=_RANK.__getitem__, default="pure")


def _checks(inputs: Iterable[Param]) -> dict[str, Check]:
    return {p.name: make_check(p.type) for p in inputs}


def _required(inputs: Iterable[Param]) -> frozenset[str]:
    return frozenset(p.name for p in inputs if p.required)
