"""Contract values as protobuf messages, with the `.proto` derived from the classes so that it cannot drift from them.

A field's number is its place in the class: new fields go last. Arrays are `Array` messages with their raw bytes.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message, message_factory, unknown_fields

from gap_runtime.contracts.encoding.codec import array_layout, array_of, field_refs, from_plain, to_raw
from gap_runtime.contracts.failures import BadRequestError, did_you_mean
from gap_runtime.contracts.types import CONTRACT_TYPES, Array
from gap_runtime.contracts.types.typeref import TypeRef

PACKAGE, FILE = "gap.v1", "gap/v1/types.proto"
MAX_BYTES = 64_000_000
_Field = descriptor_pb2.FieldDescriptorProto
_SCALARS = {
    "float": _Field.TYPE_DOUBLE,
    "int": _Field.TYPE_INT64,
    "bool": _Field.TYPE_BOOL,
    "string": _Field.TYPE_STRING,
}
_WORDS = {
    _Field.TYPE_DOUBLE: "double", _Field.TYPE_INT64: "int64", _Field.TYPE_BOOL: "bool", _Field.TYPE_STRING: "string",
    _Field.TYPE_BYTES: "bytes",
}  # fmt: skip


def to_proto(value: Any) -> bytes:
    """The bytes of the message for a contract value. Raises `BadRequestError`."""
    out = message_class(type(value).__name__)()
    try:
        _fill(out, to_raw(value))
        encoded: bytes = out.SerializeToString(deterministic=True)
    except (ValueError, TypeError, UnicodeError, message.EncodeError) as error:
        raise BadRequestError("type", f"{type(value).__name__} cannot be sent: {error}") from None
    return encoded


def from_proto(data: bytes, type_: TypeRef | str) -> Any:
    """The contract value of type `type_` in `data`, checked as any other. Raises `BadRequestError`."""
    ref = TypeRef.parse(type_) if isinstance(type_, str) else type_
    if len(data) > MAX_BYTES:
        raise BadRequestError("wire", f"a message larger than {MAX_BYTES // 1_000_000} MB")
    read = message_class(ref.name)()
    try:
        read.ParseFromString(bytes(data))
        return from_plain(_tree(read, CONTRACT_TYPES[ref.name]), TypeRef(ref.name), where=ref.name)
    except (message.DecodeError, ValueError, OverflowError) as error:
        raise BadRequestError("wire", f"not a {ref.name} message: {str(error)[:200]}") from None


def proto_text() -> str:
    """The `.proto` file of all contract types."""
    lines = ['syntax = "proto3";', "", f"package {PACKAGE};"]
    for made in _file().message_type:
        refs = field_refs(CONTRACT_TYPES[made.name]) if made.name in CONTRACT_TYPES else {}
        lines += ["", *(f"// {line}".rstrip() for line in _doc(made.name)), f"message {made.name} {{"]
        for field in made.field:
            ref = refs.get(field.name)
            label = "repeated " if field.label == _Field.LABEL_REPEATED else "optional " * field.proto3_optional
            word = _WORDS.get(field.type) or field.type_name.rpartition(".")[2]
            frame = f"  // in the {ref.frame} frame" if ref and ref.frame else ""
            lines.append(f"  {label}{word} {field.name} = {field.number};{frame}")
        lines.append("}")
    return "\n".join(lines) + "\n"


@cache
def message_class(name: str) -> type[Any]:
    """The generated message class of a contract type. Raises `BadRequestError` for a name that is none."""
    if name not in CONTRACT_TYPES:
        raise BadRequestError("type", f"{name} is not a contract type.", hint=did_you_mean(name, CONTRACT_TYPES))
    made: type[Any] = message_factory.GetMessageClass(_pool().FindMessageTypeByName(f"{PACKAGE}.{name}"))
    return made


@cache
def _pool() -> descriptor_pool.DescriptorPool:
    pool = descriptor_pool.DescriptorPool()
    pool.Add(_file())
    return pool


@cache
def _file() -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto(name=FILE, package=PACKAGE, syntax="proto3")
    array = file.message_type.add(name="Array")
    array.field.add(name="dtype", number=1, type=_Field.TYPE_STRING, label=_Field.LABEL_OPTIONAL)
    array.field.add(name="shape", number=2, type=_Field.TYPE_INT64, label=_Field.LABEL_REPEATED)
    array.field.add(name="data", number=3, type=_Field.TYPE_BYTES, label=_Field.LABEL_OPTIONAL)
    for name, cls in CONTRACT_TYPES.items():
        made = file.message_type.add(name=name)
        for number, (field, ref) in enumerate(field_refs(cls).items(), 1):
            _add_field(made, field, number, ref)
    return file


def _add_field(made: descriptor_pb2.DescriptorProto, name: str, number: int, ref: TypeRef | None) -> None:
    repeated = ref is not None and ref.is_list
    field = made.field.add(name=name, number=number, label=_Field.LABEL_REPEATED if repeated else _Field.LABEL_OPTIONAL)
    if ref is not None and ref.name in _SCALARS:
        field.type = _SCALARS[ref.name]
        if ref.optional and not repeated:
            field.proto3_optional = True
            field.oneof_index = len(made.oneof_decl)
            made.oneof_decl.add(name=f"_{name}")
        return
    field.type = _Field.TYPE_MESSAGE
    field.type_name = f".{PACKAGE}.{ref.name if ref else 'Array'}"


def _fill(out: Any, tree: Mapping[str, Any]) -> None:
    for name, value in tree.items():
        if isinstance(value, Mapping):
            getattr(out, name).SetInParent()
            _fill(getattr(out, name), value)
        elif isinstance(value, np.ndarray):
            _fill_array(getattr(out, name), value)
        elif not isinstance(value, list):
            setattr(out, name, value)
        elif value and isinstance(value[0], Mapping):
            for item in value:
                _fill(getattr(out, name).add(), item)
        else:
            getattr(out, name).extend(value)


def _fill_array(out: Any, array: Array) -> None:
    little = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
    out.dtype, out.data = little.dtype.str, little.tobytes()
    out.shape.extend(array.shape)


def _tree(read: Any, cls: type) -> dict[str, Any]:
    _refuse_unknown(read)
    return dict(_items(read, cls))


def _items(read: Any, cls: type) -> Iterator[tuple[str, Any]]:
    for name, ref in field_refs(cls).items():
        value, inner = getattr(read, name), CONTRACT_TYPES.get(ref.name) if ref else None
        if ref is not None and ref.is_list:
            yield name, [_tree(v, inner) for v in value] if inner else list(value)
        elif (ref is None or inner or ref.optional) and not read.HasField(name):
            continue
        elif ref is None:
            yield name, _array(value)
        else:
            yield name, _tree(value, inner) if inner else value


def _refuse_unknown(read: Any) -> None:
    if len(unknown_fields.UnknownFieldSet(read)):
        raise ValueError(f"{read.DESCRIPTOR.name} has fields we do not know")


def _array(read: Any) -> Array:
    _refuse_unknown(read)
    dtype, shape = array_layout(read.dtype, list(read.shape))
    return array_of(dtype, shape, np.frombuffer(read.data, np.uint8))


def _doc(name: str) -> list[str]:
    if name == "Array":
        return ["An array: numpy dtype string, little-endian; shape; bytes in C order."]
    cls = CONTRACT_TYPES[name]
    return inspect.cleandoc(cls.__doc__ or "").splitlines()
