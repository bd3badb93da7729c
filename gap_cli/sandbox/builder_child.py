"""In the child: run builder code and write its graph to the host as JSON."""

from __future__ import annotations

import json
import sys
import types
from typing import Any

from gap_cli.builder import workflow as builder
from gap_cli.sandbox.confine import REPLY_FD, REQUEST_FD
from gap_cli.sandbox.error_report import blame, remember
from gap_cli.sandbox.framing import read_frame, write_frame
from gap_cli.sandbox.lint import BUILDER, report
from gap_runtime.contracts.failures import GapError

FILENAME = "<builder>"
PROVIDED = ("WorkflowSpec", "Subgraph", "Ref", "ServiceCall", "START", "END")
RESULTS = {"spec": "WorkflowSpec", "sg": "Subgraph"}


def _alias(name: str) -> None:
    """Make `name` importable as a module that offers what builder code may use, and nothing else."""
    module = types.ModuleType(name)
    for provided in PROVIDED:
        setattr(module, provided, getattr(builder, provided))
    sys.modules[name] = module
    parent, _, leaf = name.rpartition(".")
    if parent:
        setattr(sys.modules[parent], leaf, module)


for _name in ("vos", "vos.builder", "vos.runtime", "vos.runtime.workflow"):
    _alias(_name)


def main() -> None:
    """Read one job, run it, write one reply: `{"result": ...}` or `{"error": ...}`."""
    job = json.loads(read_frame(REQUEST_FD))
    ballast = [bytes(4 << 20)]  # given back when memory runs out, so that we can still say so
    try:
        problem = report(job["source"], BUILDER, FILENAME)
        payload = _encode({"error": problem}) if problem else _output(run(job["source"], job["expect"]))
    except BaseException as error:
        ballast.clear()
        payload = _encode({"error": blame(error, FILENAME)})
    write_frame(REPLY_FD, payload)


def _encode(reply: dict[str, Any]) -> bytes:
    return json.dumps(reply, allow_nan=False, separators=(",", ":")).encode("ascii")


def _output(result: dict[str, Any]) -> bytes:
    try:
        return _encode({"result": result})
    except (TypeError, ValueError, RecursionError) as error:
        return _encode({"error": {"cause": "output", "message": f"the graph cannot be written as JSON ({error})"}})


def run(source: str, expect: str | None) -> dict[str, Any]:
    """Execute builder code and return its `spec` or `sg` as plain data, with the name of the variable."""
    remember(source, FILENAME)
    space: dict[str, Any] = {"__name__": "builder", "__builtins__": __builtins__}
    space |= {name: getattr(builder, name) for name in PROVIDED}
    exec(compile(source, FILENAME, "exec", dont_inherit=True), space)
    names = [expect] if expect else list(RESULTS)
    found = [n for n in names if isinstance(space.get(n), getattr(builder, RESULTS[n]))]
    if len(found) != 1:
        wanted = " or ".join(f"{n} = {RESULTS[n]}(...)" for n in names)
        raise GapError(f"it must bind {'only one of ' if found else ''}{wanted} at module level")
    data: dict[str, Any] = space[found[0]].to_dict()
    return data
