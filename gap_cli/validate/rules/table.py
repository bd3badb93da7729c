"""The table of all rules, with an example that fails and one that passes: `python -m gap_cli.validate.rules.table`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

from gap_runtime.contracts.documents import parse_yaml

FAMILIES = {
    "S": "Structure: the paper's own rules, by its numbers",
    "W": "Workflow: the file, its names, and the topology",
    "D": "Data: what flows along references",
    "R": "Resources: what parallel branches may do to each other",
    "P": "Privilege: what a policy may see",
    "K": "Skill contracts and checkpoints",
}
PREAMBLE = """\
# The rules of the validator

`gap validate` reports every finding of every rule at once, each with its code. This page is written by
`python -m gap_cli.validate.rules.table > docs/rules.md` from the table the tests run.

The examples show the lines that matter and leave out the rest: nodes run in the order they are added where no edge is
given, `done` is the exit, `failed` the failure, `see` finds the target box that `pick` takes.
"""


@dataclass(frozen=True)
class RuleEntry:
    """One rule. `at` says where its examples stand: inside a subgraph, in the topology, or in the JSON."""

    code: str
    says: str
    at: Literal["sg", "spec", "data"]
    fails: str
    passes: str


@cache
def rules() -> tuple[RuleEntry, ...]:
    """All rules, in the order of the table."""
    text = files("gap_cli.validate.rules").joinpath("rules.yaml").read_text(encoding="utf-8")
    return tuple(RuleEntry(**entry) for entry in parse_yaml(text, "rules.yaml"))


def markdown() -> str:
    """The table as docs/rules.md."""
    parts = [PREAMBLE]
    for family, title in FAMILIES.items():
        parts.append(f"## {title}\n")
        for rule in rules():
            if rule.code[0] == family:
                parts.append(f"### {rule.code}\n\n{rule.says}\n")
                parts.append(f"Fails:\n\n```python\n{rule.fails}```\n\nPasses:\n\n```python\n{rule.passes}```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    print(markdown(), end="")  # noqa: T201
