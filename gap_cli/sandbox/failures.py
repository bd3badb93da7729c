"""The failures of the contract that a script may raise or be given, as plain data and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gap_cli.sandbox.exit_status import clean
from gap_runtime.contracts import failures
from gap_runtime.contracts.encoding.framing import pack
from gap_runtime.contracts.failures import BadRequestError, ToolError

KINDS: dict[str, type[ToolError]] = {
    c.__name__: c
    for c in (
        ToolError, BadRequestError, failures.PerceptionError, failures.PlanningError, failures.MotionError,
        failures.GraspError,
    )
}  # fmt: skip


def described(error: ToolError) -> dict[str, Any]:
    """Its kind and fields; a subclass the contract does not know becomes the nearest that it does."""
    kind = next(c.__name__ for c in type(error).__mro__ if c.__name__ in KINDS)
    try:
        pack(error.detail)
        detail = error.detail
    except BadRequestError:
        detail = {}
    return {"kind": kind, "code": str(error.code), "message": error.message, "hint": error.hint, "detail": detail}


def revived(report: Mapping[str, Any]) -> ToolError | None:
    """The failure described, or None where the report is of something else. Its words are made safe to print."""
    kind, detail = report.get("kind"), report.get("detail")
    if not isinstance(kind, str) or kind not in KINDS:
        return None
    code = clean(report.get("code"))[:40] or "script"
    hint = clean(report.get("hint"))
    return KINDS[kind](code, clean(report.get("message")), hint=hint, detail=detail if isinstance(detail, dict) else {})
