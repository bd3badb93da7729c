"""Every error the engine raises on purpose.

GapError                      root; exit code 1 unless said otherwise (contracts/failures.py)
├── UnknownNameError          a task, skill, tool, run, ... that does not exist
├── DocumentError             a YAML/JSON/SKILL.md file that cannot be accepted
├── ToolError                 a tool could not do what was asked
│   ├── BadRequestError       arguments outside the contract
│   ├── PerceptionError       nothing certain enough in the pixels
│   ├── PlanningError         no motion found
│   ├── MotionError           the arm did not follow
│   └── GraspError            nothing held
├── PrivilegedReadError       a policy read ground truth (exit code 3)
├── SimulationDivergedError   physics blew up; the episode is void
├── TaskInfeasibleError       a belief region cannot hold its objects
├── CancelledError            a node was told to stop
├── PluginError               a plugin is broken or clashes with another
├── RunError                  a run folder that is missing, in use, or not at this stage yet
├── WorkflowError             a workflow the validator refuses; carries all findings
├── ExecutionError            a node failed at run time; carries every branch's exception
├── InstructionError          a sentence the author cannot serve
├── SandboxError              builder code was stopped, or the jail cannot be set up
├── EnvironmentSetupError     something this machine lacks (a software OpenGL, ...)
└── StorageError              the disk refused (full, read-only, gone)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from gap_runtime.contracts.failures import (
    BadRequestError,
    CancelledError,
    DocumentError,
    GapError,
    GraspError,
    InstructionError,
    MotionError,
    PerceptionError,
    PlanningError,
    PrivilegedReadError,
    SimulationDivergedError,
    TaskInfeasibleError,
    ToolError,
    UnknownNameError,
    did_you_mean,
)

__all__ = [
    "BadRequestError",
    "CancelledError",
    "DocumentError",
    "EnvironmentSetupError",
    "ExecutionError",
    "Finding",
    "GapError",
    "GraspError",
    "InstructionError",
    "MotionError",
    "PerceptionError",
    "PlanningError",
    "PluginError",
    "PrivilegedReadError",
    "RunError",
    "SandboxError",
    "SimulationDivergedError",
    "StorageError",
    "TaskInfeasibleError",
    "ToolError",
    "UnknownNameError",
    "WorkflowError",
    "did_you_mean",
]


class PluginError(GapError):
    """A plugin cannot be used: it failed to load, misspelled a hook, or clashes with another by name."""


class RunError(GapError):
    """A run folder that is missing, in use by another process, or not at this stage yet."""


@dataclass(frozen=True, order=True)
class Finding:
    """One problem. `path` is where in the workflow (`subgraphs.grasp_sg.nodes.close.inputs.arm_id`); `file`
    and `line` are where that is written, where it is known. An `error` stops the workflow; a `note` does not."""

    path: str
    code: str
    message: str
    hint: str = ""
    severity: Literal["error", "note"] = "error"
    file: str = ""
    line: int | None = None

    @property
    def source(self) -> str:
        """`file:line`, as far as known."""
        return f"{self.file}:{self.line}" if self.file and self.line else self.file or str(self.line or "")

    def as_dict(self) -> dict[str, Any]:
        """Plain data, None left out."""
        return {k: v for k, v in asdict(self).items() if v not in (None, "")}


class WorkflowError(GapError):
    """A workflow the validator refuses. `findings` holds all of them, not just the first."""

    def __init__(self, findings: Sequence[Finding], *, what: str = "The workflow") -> None:
        self.findings = tuple(findings)
        first = self.findings[0]
        more = f" (and {len(self.findings) - 1} more)" if len(self.findings) > 1 else ""
        super().__init__(f"{what} is not valid: {first.code} at {first.path}: {first.message}{more}", hint=first.hint)


class ExecutionError(GapError):
    """A node failed while a graph ran. `causes` holds the exception of every branch that failed."""

    def __init__(self, message: str, causes: Sequence[BaseException], *, hint: str = "") -> None:
        self.causes = tuple(causes)
        super().__init__(message, hint=hint)


class SandboxError(GapError):
    """Builder code or an inline script was stopped by the jail, broke its rules, or the jail could not be set up.

    `cause` is one word: timeout, memory, output, syscall, forbidden, error, crash or unavailable; `line` is the line of
    the jailed source, where one is to blame.
    """

    def __init__(self, message: str, *, hint: str = "", cause: str = "error", line: int | None = None) -> None:
        self.cause = cause
        self.line = line
        super().__init__(message, hint=hint)


class EnvironmentSetupError(GapError):
    """This machine lacks something GaP needs; the hint says exactly what to install."""


class StorageError(GapError):
    """The disk refused: full, read-only, or gone. Nothing half-written is left behind."""
