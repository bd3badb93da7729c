"""Turns the inputs and outputs a workflow writes as data into readers of a subgraph activation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gap_runtime.contracts.failures import BadRequestError, UnknownNameError
from gap_runtime.graph.compiled import UNSET, ActivationValues, Reader, StreamOwner
from gap_runtime.graph.references import STREAM, Reference, is_reference, references_in, walk
from gap_runtime.graph.values import copy_containers


@dataclass(frozen=True)
class ReferenceScope:
    """What the references of one subgraph may name."""

    path: str
    slots: Mapping[str, int]
    streaming: frozenset[str]
    inputs: Mapping[str, str]  # name -> type; one that ends in "?" need not be there
    parameters: Mapping[str, Any]


def is_constant(data: Any) -> bool:
    """True when `data` reads nothing that is only known at run time."""
    return all(r is not None and r.source == "param" for _, r in references_in(data))


def constant(data: Any, scope: ReferenceScope, where: str) -> Any:
    """The value of data that `is_constant`."""
    if is_reference(data):
        reference = Reference.parse(data["$ref"])
        if reference.name not in scope.parameters:
            raise UnknownNameError(f"parameter ({where})", reference.name, scope.parameters)
        return walk(scope.parameters[reference.name], reference.fields, where)
    if isinstance(data, Mapping):
        return {key: constant(value, scope, where) for key, value in data.items()}
    if isinstance(data, list):
        return [constant(value, scope, where) for value in data]
    return data


def make_reader(data: Any, scope: ReferenceScope, where: str, *, live: bool = False) -> Reader:
    """A function of the activation that gives the value of `data`. Raises `UnknownNameError` at once.

    With `live`, `in.observation_stream` gives the stream itself rather than its latest observation.
    """
    if is_reference(data):
        return _reference_reader(Reference.parse(data["$ref"]), scope, where, live)
    if isinstance(data, Mapping):
        parts = {key: make_reader(value, scope, where) for key, value in data.items()}
        return lambda activation, owner: {key: read(activation, owner) for key, read in parts.items()}
    if isinstance(data, list):
        items = [make_reader(value, scope, where) for value in data]
        return lambda activation, owner: [read(activation, owner) for read in items]
    return lambda activation, owner: data


def _reference_reader(reference: Reference, scope: ReferenceScope, where: str, live: bool) -> Reader:
    if reference.source == "param":
        value = constant({"$ref": str(reference)}, scope, where)
        return lambda activation, owner: value
    if reference.source == "in":
        if reference.name == STREAM:
            return _observations(live)
        if reference.name not in scope.inputs:
            raise UnknownNameError(f"input ({where})", reference.name, [*scope.inputs, STREAM])
        return _input(reference, where, optional=scope.inputs[reference.name].endswith("?"))
    if reference.name not in scope.slots:
        raise UnknownNameError(f"node ({where})", reference.name, scope.slots)
    if reference.name in scope.streaming:
        return _stream(scope.slots[reference.name], reference, where)
    return _slot(scope.slots[reference.name], reference, where)


def _slot(index: int, reference: Reference, where: str) -> Reader:
    fields = reference.fields

    def read(activation: ActivationValues, owner: StreamOwner | None) -> Any:
        value = activation.slots[index]
        if value is UNSET:
            raise BadRequestError("reference", f"{where}: node {reference.name!r} has not run on this path")
        return copy_containers(walk(value, fields, where) if fields else value)

    return read


def _input(reference: Reference, where: str, *, optional: bool) -> Reader:
    name, fields = reference.name, reference.fields

    def read(activation: ActivationValues, owner: StreamOwner | None) -> Any:
        value = activation.inputs.get(name, UNSET)
        if value is UNSET and optional and not fields:
            return None
        if value is UNSET:
            raise BadRequestError("reference", f"{where}: nothing upstream has produced {name!r}")
        return copy_containers(walk(value, fields, where) if fields else value)

    return read


def _stream(index: int, reference: Reference, where: str) -> Reader:
    def read(activation: ActivationValues, owner: StreamOwner | None) -> Any:
        stream = activation.streams.get(index)
        if stream is None:
            raise BadRequestError("reference", f"{where}: streaming node {reference.name!r} has not been started")
        return copy_containers(walk(stream.latest(owner), reference.fields, where))

    return read


def _observations(live: bool) -> Reader:
    def read(activation: ActivationValues, owner: StreamOwner | None) -> Any:
        stream = activation.observations()
        return stream.reader(owner) if live and owner is not None else stream.latest(owner)

    return read
