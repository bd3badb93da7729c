"""run.yaml: what was asked of a run, and nothing that depends on when or where."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from gap_runtime.contracts.models import Document

SCHEMA: Literal["gap/run/v1"] = "gap/run/v1"


class Asked(Document):
    """The question a run answers. `seed` is the base seed of its rehearsals; `providers` maps a tool name or
    `service.*` to the provider that must serve it."""

    schema_: Literal["gap/run/v1"] = Field(default=SCHEMA, alias="schema")
    task: str = Field(pattern=r"^[a-z][a-z0-9]*(-[a-z0-9]+)*$", max_length=64)
    variant: str = ""
    instruction: str = Field(min_length=1)
    author: str = "symbolic"
    seed: int = 0
    providers: dict[str, str] = {}
