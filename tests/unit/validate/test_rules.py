"""Every rule bites on its failing example and lets its passing one through; the docs are the same table."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gap_cli.validate import rules as package
from gap_cli.validate.rules.table import FAMILIES, markdown, rules
from tests.unit.validate.kit import findings_at

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("rule", rules(), ids=lambda r: r.code)
def test_the_failing_example_is_caught_by_its_rule(rule):
    found = findings_at(rule.at, rule.fails)
    assert rule.code in {f.code for f in found}
    assert all(f.message and f.path for f in found)


@pytest.mark.parametrize("rule", rules(), ids=lambda r: r.code)
def test_the_passing_example_has_no_finding(rule):
    assert findings_at(rule.at, rule.passes) == []


def test_every_code_the_rules_use_is_in_the_table():
    folder = Path(package.__path__[0])
    rooms = (folder, ROOT / "gap_runtime/graph", ROOT / "gap_cli/builder")
    sources = [p for room in rooms for p in room.glob("*.py")]
    used = {c for p in sources for c in re.findall(r'"([SWDRPK]\d{1,2})"', p.read_text())}
    assert used == {r.code for r in rules()}
    assert {c[0] for c in used} == set(FAMILIES)


def test_the_docs_are_the_table():
    assert (ROOT / "docs" / "rules.md").read_text() == markdown(), (
        "run: python -m gap_cli.validate.rules.table > docs/rules.md"
    )
