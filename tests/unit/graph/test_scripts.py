"""A script's signature, read without running it."""

from __future__ import annotations

import textwrap

import pytest

from gap_runtime.contracts.tool import REQUIRED
from gap_runtime.errors import DocumentError
from gap_runtime.graph.scripts import COMPUTED, read_signature

HEAD = """
from __future__ import annotations
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple, NotRequired, Optional, TypedDict
from gap_runtime.contracts import types
from gap_runtime.contracts.types import CAMERA, WORLD, CameraObservation, Frame, Mask, PointCloud, Vec3
from gap_runtime.contracts.types import OrientedBoundingBox as Box
from gap_runtime.contracts.tool import ScriptContext
WorldCloud = Annotated[PointCloud, WORLD]
"""


def read(source):
    return read_signature(HEAD + textwrap.dedent(source), "scripts/x.py")


@pytest.mark.parametrize(("annotation", "type_"), [
    ("float", "float"), ("int", "int"), ("bool", "bool"), ("str", "string"), ("Any", "any"), ("dict", "any"),
    ("dict[str, float]", "any"), ("Mask", "Mask"), ("'Mask'", "Mask"), ("types.Mask", "Mask"),
    ("Box", "OrientedBoundingBox"), ("list[Mask]", "Mask[]"), ("tuple[Mask, ...]", "Mask[]"),
    ("Sequence[CameraObservation]", "CameraObservation[]"), ("Mask | None", "Mask?"), ("Optional[Mask]", "Mask?"),
    ("list[Mask] | None", "Mask[]?"), ("WorldCloud", "PointCloud[world]"), ("list[WorldCloud]", "PointCloud[world][]"),
    ("Annotated[PointCloud, CAMERA]", "PointCloud[camera]"), ("Annotated[Vec3, Frame('tool')]", "Vec3[tool]"),
    ("Literal['a', 'b']", "string"), ("Literal[1, 2]", "int"), ("list", "any[]"),
])  # fmt: skip
def test_annotations_are_contract_types(annotation, type_):
    spec = read(f"def run(ctx, x: {annotation}) -> None: ...")
    assert str(spec.inputs[0].type) == type_
    assert str(read(f"def run(ctx) -> {annotation}: ...").output) == type_


def test_defaults_are_literals_or_known_to_be_there():
    spec = read("def run(ctx, a: int, b: float = -0.1, c: Vec3 = Vec3(0, 0, 1), *, d: str = 'x') -> None: ...")
    assert [(p.name, p.default) for p in spec.inputs] == [("a", REQUIRED), ("b", -0.1), ("c", COMPUTED), ("d", "x")]
    assert [p.required for p in spec.inputs] == [True, False, False, False]


@pytest.mark.parametrize("kind", ["class R(NamedTuple):", "class R(TypedDict):", "@dataclass(frozen=True)\nclass R:"])
def test_a_bundle_gives_named_results(kind):
    spec = read(f"{kind}\n    found: bool\n    cloud: WorldCloud\n    mask: Mask | None\n\ndef run(ctx) -> R: ...")
    assert {n: str(t) for n, t in spec.fields.items()} == {
        "found": "bool",
        "cloud": "PointCloud[world]",
        "mask": "Mask?",
    }
    assert spec.output is None


def test_the_words_of_a_literal_are_kept():
    spec = read("class R(TypedDict):\n    state: Literal['held', 'empty']\n\ndef run(ctx) -> R: ...")
    assert spec.choices == {"state": ("held", "empty")}
    assert read("def run(ctx) -> Literal['left', 'right']: ...").choices == {"": ("left", "right")}


def test_a_stream_is_known_by_what_it_yields_or_publishes():
    spec = read("def run(ctx: ScriptContext) -> Iterator[Mask]:\n    yield 1")
    assert (str(spec.output), spec.publishes) == ("Mask", True)
    assert read("def run(ctx) -> Mask:\n    ctx.publish(1)").publishes
    assert not read("def run(ctx) -> Mask: ...").publishes


def test_tools_named_in_the_source_are_known_and_computed_ones_admitted():
    spec = read("""
        def helper(ctx):
            return ctx.tool("sam3.SegmentBox")

        def run(ctx) -> None:
            ctx.tool("gripper.Open", arm_id=0)
    """)
    assert spec.tools == {"sam3.SegmentBox", "gripper.Open"} and not spec.any_tool
    assert read("def run(ctx, n: str) -> None:\n    ctx.tool(n)").any_tool
    assert read("def run(ctx) -> None:\n    t = ctx.tool\n    t('a.B')").any_tool


@pytest.mark.parametrize(("source", "says"), [
    ("x = 1", "no function run"),
    ("def run(ctx) -> None", "is not Python"),
    ("def run(context) -> None: ...", "must be ctx"),
    ("def run() -> None: ...", "must be ctx"),
    ("def run(ctx, x) -> None: ...", "'x' of run has no type"),
    ("def run(ctx, *args) -> None: ...", "args"),
    ("def run(ctx, **kwargs) -> None: ...", "kwargs"),
    ("def run(ctx): ...", "does not say what it returns"),
    ("def run(ctx, x: PointCluod) -> None: ...", "PointCloud"),
    ("def run(ctx, x: Mask | Vec3) -> None: ...", "unions"),
    ("def run(ctx, x: set[int]) -> None: ...", "set"),
    ("def run(ctx, x: Literal['a', 1]) -> None: ...", "Literal"),
    ("class R:\n    pass\n\ndef run(ctx) -> R: ...", "is not a result"),
    ("A = B\nB = A\n\ndef run(ctx, x: A) -> None: ...", "alias of itself"),
    ("def run(ctx) -> '(': ...", "is not a type"),
    ("async def run(ctx) -> None: ...", "no function run"),
    ("\u202edef run(ctx) -> None: ...", "invisible"),
    ("(" * 5000, "is not Python"),
])  # fmt: skip
def test_what_cannot_be_a_script_is_refused_in_words(source, says):
    with pytest.raises(DocumentError) as error:
        read_signature(HEAD + source if "class" in source or "run" in source else source, "scripts/x.py")
    assert says in str(error.value) and error.value.where.startswith("scripts/x.py")
