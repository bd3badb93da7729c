"""Who writes graphs: the author, and the language model that one may drive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from gap_runtime.contracts.skill import SkillContract
from gap_runtime.contracts.task import Task
from gap_runtime.contracts.tool import ToolSpec


class Skill(Protocol):
    """A skill as an author reads it: its SKILL.md and its typed contract."""

    @property
    def name(self) -> str:
        """Kebab-case name."""

    @property
    def description(self) -> str:
        """What it does and when to use it."""

    @property
    def body(self) -> str:
        """The text of its SKILL.md below the frontmatter."""

    @property
    def contract(self) -> SkillContract:
        """Inputs, outputs, exits, needs, effects, tools and parameters."""


@dataclass(frozen=True)
class AuthorRequest:
    """What is to be done, and what there is to do it with."""

    task: Task
    instruction: str
    skills: Mapping[str, Skill]
    tools: Mapping[str, ToolSpec]


class Author(Protocol):
    """Writes graphs. What it hands over is not trusted: data is checked, code runs in the sandbox, and the graph must
    pass the validator."""

    def plan(self, request: AuthorRequest) -> Mapping[str, Any]:
        """The content of plan.json: scene, goals, and segments with their skills (`gap/plan/v1`).

        Raises `InstructionError` where the instruction cannot be served.
        """

    def subgraph(
        self,
        request: AuthorRequest,
        plan: Mapping[str, Any],
        segment: str,
        findings: Sequence[Mapping[str, Any]],
    ) -> str | None:
        """Builder code of one segment of the plan; None to use the canonical template of its skill.

        `findings` are what the validator said of the code given before (`path`, `code`, `message`, `hint`); empty the
        first time.
        """


@dataclass(frozen=True)
class Function:
    """A function that a language model may call; `parameters` is a JSON Schema of an object."""

    name: str
    description: str
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class FunctionCall:
    """A call that a language model asks for; the result goes back under the same `id`."""

    id: str
    name: str
    arguments: Mapping[str, Any]


@dataclass(frozen=True)
class Message:
    """One turn of a conversation. `calls` are those of an assistant, `call_id` is the one a tool's text answers."""

    role: Literal["system", "user", "assistant", "tool"]
    text: str
    calls: tuple[FunctionCall, ...] = ()
    call_id: str = ""


@dataclass(frozen=True)
class Completion:
    """What a language model answered, and the tokens that it took."""

    message: Message
    input_tokens: int = 0
    output_tokens: int = 0


class LanguageModel(Protocol):
    """A language model, wherever it runs."""

    @property
    def name(self) -> str:
        """Provider and model, as a run's lock records them."""

    def complete(self, messages: Sequence[Message], functions: Sequence[Function] = ()) -> Completion:
        """The next message of the conversation. Raises `GapError` where the model cannot be reached or refuses."""
