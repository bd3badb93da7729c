"""A second provider of a contract: the same schema hash, its own function, deadline and words."""

from __future__ import annotations

import pytest

from gap_runtime.contracts.tool import serves, tool


@tool("lamp.Light", deadline_s=2.0)
def embedded(level: float, colour: str = "white") -> float:
    """Light the lamp."""
    return level


def test_the_contract_is_shared_and_the_function_is_not():
    @serves(embedded, provider="remote", deadline_s=30.0)
    def remote(ctx, level, colour):
        """Ask another machine to light the lamp."""
        return 2 * level

    assert remote.spec.schema_hash == embedded.spec.schema_hash
    assert (remote.provider, remote.takes_context, remote.spec.deadline_s) == ("remote", True, 30.0)
    assert remote.spec.summary == "Ask another machine to light the lamp."
    assert remote(None, level=0.5, colour="red") == 1.0


def test_without_words_of_its_own_the_contracts_stand():
    @serves(embedded, provider="remote")
    def remote(level, colour):
        return level

    assert (remote.spec.doc, remote.spec.deadline_s) == ("Light the lamp.", 2.0)


def test_other_inputs_are_refused():
    with pytest.raises(TypeError, match=r"lamp\.Light.*level, colour"):

        @serves(embedded, provider="remote")
        def remote(ctx, level):
            return level


def test_another_output_is_refused():
    with pytest.raises(TypeError, match=r"lamp\.Light.*returns something else"):

        @serves(embedded, provider="remote")
        def remote(level, colour) -> str:
            return colour
