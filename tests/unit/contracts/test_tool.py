"""A contract is a request class; providers serve it, and a tool that nobody else serves is a typed function."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from types import new_class
from typing import Annotated, NamedTuple

import pytest

from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.tool import ToolContext, ToolRequest, serves, tool
from gap_runtime.contracts.types import WORLD, PointCloud


class Lit(NamedTuple):
    """How bright it is."""

    level: float


class Light(ToolRequest[Lit], tool="lamp.Light", effect="sense", deadline_s=2.0):
    """Light the lamp.

    Raises `BadRequestError`.
    """

    level: float
    colour: str = "white"

    def __post_init__(self) -> None:
        if self.level < 0:
            raise BadRequestError("range", f"level is {self.level}.")


@serves(Light)
def embedded(request: Light) -> Lit:
    """By hand."""
    return Lit(request.level)


def test_the_contract_is_the_class():
    spec = Light.contract
    assert (spec.name, spec.effect, spec.deadline_s, spec.summary) == ("lamp.Light", "sense", 2.0, "Light the lamp.")
    assert [(p.name, str(p.type), p.required) for p in spec.inputs] == [
        ("level", "float", True),
        ("colour", "string", False),
    ]
    assert {n: str(t) for n, t in spec.fields.items()} == {"level": "float"}


def test_a_function_with_the_same_signature_has_the_same_hash():
    @tool("lamp.Light", effect="sense")
    def light(ctx: ToolContext, level: float, colour: str = "white") -> Lit:
        """Another text."""
        return Lit(level)

    assert light.spec.schema_hash == Light.contract.schema_hash


def test_a_call_makes_the_request_and_the_request_refuses_what_no_provider_takes():
    assert embedded(None, level=0.5) == Lit(0.5)
    with pytest.raises(BadRequestError, match=r"level is -1\.0"):
        embedded(None, level=-1.0)
    with pytest.raises(TypeError, match="level"):
        embedded(None, colour="red")


def test_a_request_cannot_be_changed():
    with pytest.raises(FrozenInstanceError):
        Light(0.5).level = 1.0


def test_providers_share_the_contract_and_differ_in_the_rest():
    @serves(Light, provider="remote", deadline_s=30.0)
    def remote(ctx: ToolContext, request: Light) -> Lit:
        """By another machine."""
        return Lit(2 * request.level)

    assert remote.spec.schema_hash == embedded.spec.schema_hash and remote.spec.doc == embedded.spec.doc
    assert (remote.provider, remote.takes_context, remote.spec.deadline_s) == ("remote", True, 30.0)
    assert (remote.notes, embedded.notes) == ("By another machine.", "By hand.")
    assert remote(None, level=0.5) == Lit(1.0)


def test_a_frame_of_the_result_is_the_contracts_to_state():
    class See(ToolRequest[Annotated[PointCloud, WORLD]], tool="lamp.See"):
        """See what it shines on."""

    globals()["See"] = See  # where annotations of this module are looked up

    @serves(See)
    def see(request: See) -> PointCloud:
        return PointCloud([[0.0, 0.0, 0.0]])

    assert str(see.spec.output) == "PointCloud[world]" and see.notes == ""


def test_another_request_is_refused():
    with pytest.raises(TypeError, match=r"lamp\.Light.*one Light"):

        @serves(Light)
        def other(ctx: ToolContext, level: float) -> Lit:
            return Lit(level)


def test_another_result_is_refused():
    with pytest.raises(TypeError, match=r"lamp\.Light.*does not return"):

        @serves(Light)
        def other(request: Light) -> float:
            return request.level


@pytest.mark.parametrize("name, doc, problem", [("Light", "Text.", "service.Method"), ("lamp.Light", "", "docstring")])
def test_what_is_no_contract_is_refused(name, doc, problem):
    with pytest.raises(TypeError, match=problem):
        new_class("Broken", (ToolRequest[None],), {"tool": name}, lambda body: body.update(__doc__=doc))
