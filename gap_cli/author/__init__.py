"""Who writes graphs: a plan and a graph are asked of the author that is named; the symbolic one registers here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, cast

from gap_runtime.contracts.author import Author, AuthorRequest
from gap_runtime.contracts.documents import check_text
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec
from gap_runtime.errors import (
    DocumentError,
    GapError,
    InstructionError,
    PluginError,
    UnknownNameError,
    WorkflowError,
)
from gap_runtime.hookspecs import Register, hookimpl
from gap_runtime.plugins import Entry

if TYPE_CHECKING:
    from gap_cli.author.build import Generated
    from gap_cli.author.plans import Plan
    from gap_cli.skills import SkillLibrary

MAX_INSTRUCTION = 2000  # characters; far above any instruction, far below what would take time
ROUNDS = 3  # how often an author may answer the validator's findings
__all__ = ["generate", "plan"]


class SymbolicAuthor:
    """By grammar and by regression over the contracts of skills. No key, no network, no guess."""

    def plan(self, request: AuthorRequest) -> Mapping[str, Any]:
        """See `Author.plan`."""
        from gap_cli.author.symbolic import plan_symbolically

        library = cast("SkillLibrary", request.skills)
        return plan_symbolically(request.task, request.instruction, library, request.tools).data

    def subgraph(
        self, request: AuthorRequest, plan: Mapping[str, Any], segment: str, findings: Sequence[Mapping[str, Any]]
    ) -> str | None:
        """Always the canonical template."""
        return None


OWN = {"symbolic": Entry("symbolic", SymbolicAuthor, __name__)}


@hookimpl
def gap_register_authors(register: Register) -> None:
    """The symbolic author."""
    for entry in OWN.values():
        register(entry.name, entry.value)


def plan(
    task: Task,
    instruction: str,
    library: SkillLibrary,
    tools: Mapping[str, ToolSpec],
    authors: Mapping[str, Entry] = OWN,
    author: str = "symbolic",
) -> Plan:
    """The plan of the named author.

    Raises `InstructionError` where the instruction cannot be served, `UnknownNameError` for an author that nobody
    registered, `DocumentError` for a plan that is none, `PluginError` for an author that fails.
    """
    from gap_cli.author.plans import Plan

    with _chosen(authors, author) as writer:
        data = writer.plan(AuthorRequest(task, read_instruction(instruction), library, tools))
    given = {**data, "author": author} if isinstance(data, Mapping) else data
    return Plan.load(given, f"the plan of author {author}")


def serves(task: Task, instruction: str) -> bool:
    """Whether the symbolic author understands the instruction in a scene of the task."""
    from gap_cli.author.understand import understand

    try:
        return bool(understand(task, read_instruction(instruction)))
    except InstructionError:
        return False


def read_instruction(text: str) -> str:
    """The instruction on one line. Raises `InstructionError` where it is too long or holds what nobody can see."""
    if len(text) > MAX_INSTRUCTION:
        long = f"The instruction has {len(text)} characters; at most {MAX_INSTRUCTION} are read."
        raise InstructionError(long, hint="Give it in several runs.")
    try:
        return " ".join(check_text(text, "The instruction").split())
    except DocumentError as error:
        raise InstructionError(error.message + ".", hint="Type it again.") from None


def generate(
    plan: Plan | Mapping[str, Any],
    task: Task,
    library: SkillLibrary,
    tools: Mapping[str, ToolSpec],
    authors: Mapping[str, Entry] = OWN,
    *,
    unsafe: bool = False,
) -> Generated:
    """The workflow of a plan, written, run in the sandbox and validated; see `gap_cli.author.build`.

    Code that the plan's author wrote itself goes back to it with the findings, at most `ROUNDS` times.
    """
    from gap_cli.author.build import build
    from gap_cli.author.plans import Plan

    plan = plan if isinstance(plan, Plan) else Plan.load(plan)
    request = AuthorRequest(task, plan.content.instruction, library, tools)
    findings: list[Mapping[str, Any]] = []
    with _chosen(authors, plan.content.author) as writer:
        for left in reversed(range(ROUNDS)):
            names = [segment.name for segment in plan.content.segments]
            asked = {name: writer.subgraph(request, plan.data, name, findings) for name in names}
            written = {name: code for name, code in asked.items() if code is not None}
            try:
                return build(plan, task, library, tools, written=written, unsafe=unsafe)
            except WorkflowError as error:
                if not written or not left:
                    raise
                findings = [finding.as_dict() for finding in error.findings]
    raise AssertionError("the last round returns or raises")


@contextmanager
def _chosen(authors: Mapping[str, Entry], name: str) -> Iterator[Author]:
    """The author of that name; what it raises besides `GapError` is a `PluginError` that names its plugin."""
    if name not in authors:
        raise UnknownNameError("author", name, authors)
    try:
        yield authors[name].value()
    except GapError:
        raise
    except Exception as error:
        what = f"Author {name!r} of plugin {authors[name].plugin!r} failed"
        raise PluginError(f"{what}: {type(error).__name__}: {error}") from error
