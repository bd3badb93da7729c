import pytest

from gap_cli.sandbox.lint import BUILDER, MAX_NODES, MAX_SOURCE, SCRIPT, lint, report


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("import os", "os cannot be imported"),
        ("import vos.builder, sys", "sys cannot be imported"),
        ("from . import x", ". cannot be imported"),
        ("from vos import builder", "vos cannot be imported"),
        ("x.__class__", "attribute __class__"),
        ("sg._nodes", "attribute _nodes"),
        ("_x = 1", "name _x"),
        ("__import__('os')", "__import__ is not available"),
        ("open('x')", "open is not available"),
        ("print(1)", "print is not available"),
        ("f = eval", "eval is not available"),
        ("'{0.x}'.format(1)", "f-string"),
        ("async def f(): pass", "not asynchronous"),
        ("match 1:\n    case int(): pass", "class patterns"),
        ("x = " + "-" * 150 + "1", "deep"),
        ("x = [" + "1," * MAX_NODES + "]", "syntax nodes"),
        ("#" * (MAX_SOURCE + 1), "limited to"),
        ("\0", "null bytes"),
    ],
)
def test_builder_code_is_told_what_it_may_not(source, said):
    try:
        messages = [m for _, m in lint(source, BUILDER)]
    except SyntaxError as error:
        messages = [error.msg]
    assert any(said in m for m in messages), messages


@pytest.mark.parametrize(
    "source",
    [
        "from vos.builder import WorkflowSpec, START\nfrom vos.runtime.workflow import ServiceCall",
        "from gap_cli.builder.workflow import Subgraph\nsg = Subgraph('a', skill='b')",
        "for _ in range(3): pass",
        "names = [f'{a}_sg' for a in ('x', 'y')]\nassert names",
        "def build(n):\n    class Step: pass\n    return lambda w: w.body('x').z > 0.1",
        "match 1:\n    case [1, *_]: pass\n    case {'a': 1}: pass",
    ],
)
def test_ordinary_builder_code_has_nothing_said_about_it(source):
    assert lint(source, BUILDER) == []


def test_a_script_may_compute_and_have_its_own_helpers():
    source = "from gap_runtime.contracts.types import Mask\ndef _half(x): return '{}'.format(x)\nprint(1)"
    assert lint(source, SCRIPT) == []
    assert [m for _, m in lint("import os\n().__class__", SCRIPT)] == [
        "os cannot be imported",
        "the attribute __class__ is out of bounds",
    ]


def test_the_report_has_the_first_line_and_mentions_the_others():
    said = report("x = 1\nimport os\nopen('x')", BUILDER, "<x>")
    assert said["line"] == 2
    assert "Importable: gap_cli.builder.workflow, vos.builder" in said["hint"]
    assert "line 3" in said["hint"]
    assert report("x = 1", BUILDER, "<x>") is None
