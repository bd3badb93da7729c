"""The typed contract of a skill: contract.yaml, beside the SKILL.md that agents read."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from gap_runtime.contracts.failures import GapError
from gap_runtime.contracts.models import Document
from gap_runtime.contracts.types.typeref import TypeRef

NAME_SLOT = "<name>"  # an input or output named `<name>_obb` is spelled with the segment's role: target_obb


class Exits(Document):
    """Success exits with their meaning, and the one failure exit. A skill that gives one object after another names
    as `exhausted` the success exit by which it ends when none is left."""

    success: dict[str, str] = Field(min_length=1)
    failure: str
    exhausted: str | None = None

    @model_validator(mode="after")
    def _known(self) -> Exits:
        if self.exhausted is not None and (self.exhausted not in self.success or len(self.success) < 2):
            raise ValueError(f"exhausted {self.exhausted!r} must be one of several success exits")
        return self


class Parameter(Document):
    """Something tuning may change, and within what bounds. `choices` for words, `range` for numbers."""

    type: Literal["float", "int", "bool", "string"]
    default: Any
    range: tuple[float, float] | None = None
    choices: list[str] | None = None
    unit: str = ""
    description: str = ""

    @model_validator(mode="after")
    def _default_fits(self) -> Parameter:
        problem = self.problem_with(self.default)
        if problem:
            raise ValueError(f"default {problem}")
        return self

    def problem_with(self, value: Any) -> str:
        """Why `value` is not allowed, or ''."""
        kinds = {"float": (int, float), "int": (int,), "bool": (bool,), "string": (str,)}[self.type]
        if not isinstance(value, kinds) or (isinstance(value, bool) and self.type != "bool"):
            return f"{value!r} is not a {self.type}"
        if self.range is not None and not self.range[0] <= float(value) <= self.range[1]:
            return f"{value} is outside [{self.range[0]}, {self.range[1]}] {self.unit}".rstrip()
        if self.choices is not None and value not in self.choices:
            return f"{value!r} is not one of {', '.join(self.choices)}"
        return ""


class SkillContract(Document):
    """What a skill takes, gives, needs and promises.

    kind        composite: a subgraph; atomic: one class, callable as a tool.
    needs       facts that must hold before (`hand_empty`, `located(target)`); effects: facts that hold after a
                success exit; `-fact` means it no longer holds. Arguments are the skill's roles.
    roles       the symbolic arguments of the skill (`target`, `container`), bound by the author to task objects.
    tools       the only tools the skill's nodes may call.
    scripts     canonical scripts by logical name, paths relative to the skill.
    literals    constants the author fills in (`object_name`), with their types.
    """

    kind: Literal["composite", "atomic"]
    stage: Literal["perceive", "grasp", "transport", "place", "operate"] | None = None
    roles: list[str] = []
    inputs: dict[str, str] = {}
    outputs: dict[str, str] = {}
    literals: dict[str, str] = {}
    exits: Exits
    needs: list[str] = []
    effects: list[str] = []
    tools: list[str] = []
    scripts: dict[str, str] = {}
    prompts: dict[str, str] = {}
    references: dict[str, str] = {}
    parameters: dict[str, Parameter] = {}
    swaps: list[str] = []
    checkpoints: str | None = None
    template: str | None = None
    streaming: bool = False
    cost: float = Field(
        default=1.0, gt=0, description="relative preference among skills with the same effects; lower first"
    )

    @field_validator("inputs", "outputs", "literals")
    @classmethod
    def _types(cls, types: dict[str, str]) -> dict[str, str]:
        for name, text in types.items():
            TypeRef.parse(text)
            if not re.fullmatch(r"(<name>_)?[a-z][a-z0-9_]*", name):
                raise ValueError(f"{name!r} must be lower_snake_case, optionally starting with <name>_")
        return types

    @field_validator("scripts", "prompts", "references")
    @classmethod
    def _inside(cls, paths: dict[str, str]) -> dict[str, str]:
        for path in paths.values():
            check_relative(path)
        return paths

    @model_validator(mode="after")
    def _composite_has_template(self) -> SkillContract:
        if self.kind == "composite" and self.template is None:
            raise ValueError("a composite skill needs a template")
        for path in (self.template, self.checkpoints):
            if path is not None:
                check_relative(path)
        return self


def check_relative(path: str) -> None:
    """Raise ValueError unless `path` stays inside the skill's directory."""
    parts = path.split("/")
    if (
        path.startswith(("/", "~"))
        or "\\" in path
        or ":" in path
        or any(p in ("", ".", "..") or p != p.strip() for p in parts)
    ):
        raise ValueError(f"path {path!r} must be relative and stay inside the skill")


def inside(folder: Path, path: str) -> Path:
    """`folder / path`. Raises `GapError` where that would leave the folder."""
    try:
        check_relative(path)
        resolved = (folder / path).resolve()
    except (ValueError, OSError) as error:
        raise GapError(f"{path!r}: {error}") from None
    if not resolved.is_relative_to(folder.resolve()):
        raise GapError(f"{path!r} leads out of the workflow folder.")
    return folder / path
