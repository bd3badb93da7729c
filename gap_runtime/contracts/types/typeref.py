"""Type names as contracts write them: `Mask`, `PointCloud[world]`, `Se3Pose[world][]`, `float?`, `any`."""

from __future__ import annotations

import difflib
import re
import types
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Union, get_args, get_origin

from gap_runtime.contracts.types import CONTRACT_TYPES, SCALAR_TYPES, Frame
from gap_runtime.contracts.types.geometry import FRAMES

_GRAMMAR = re.compile(r"(?P<name>[A-Za-z_][A-Za-z0-9_]*)(\[(?P<frame>[A-Za-z_]+)\])?(?P<list>\[\])?(?P<optional>\?)?")
_NAMES = (*CONTRACT_TYPES, *SCALAR_TYPES, "any")
_NAME_OF = {v: k for k, v in {**CONTRACT_TYPES, **SCALAR_TYPES}.items()}


@dataclass(frozen=True)
class TypeRef:
    """One type in a contract. `name`: contract type, scalar, or `any`; `frame` None: it does not matter."""

    name: str
    frame: str | None = None
    is_list: bool = False
    optional: bool = False

    @classmethod
    def parse(cls, text: str) -> TypeRef:
        """From text. Raises ValueError naming the problem."""
        match = _GRAMMAR.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"{text!r} is not a type; write Name, Name[frame], Name[], or Name?")
        name = match["name"]
        if name not in _NAMES:
            raise ValueError(f"{name!r} is not a contract type" + _near(name, _NAMES))
        frame = match["frame"]
        if frame is not None and frame not in FRAMES:
            raise ValueError(f"{frame!r} is not a frame ({', '.join(FRAMES)})" + _near(frame, FRAMES))
        if frame is not None and name not in CONTRACT_TYPES:
            raise ValueError(f"{name} is not expressed in any frame")
        return cls(name, frame, match["list"] is not None, match["optional"] is not None)

    @classmethod
    def of(cls, annotation: Any) -> TypeRef:
        """From a resolved Python annotation. Raises TypeError for what no contract can carry."""
        origin, args = get_origin(annotation), get_args(annotation)
        if origin is Annotated:
            frame = next((m.name for m in args[1:] if isinstance(m, Frame)), None)
            return replace(cls.of(args[0]), frame=frame)
        if origin in (Union, types.UnionType):
            rest = [a for a in args if a is not type(None)]
            if len(rest) != 1 or len(rest) == len(args):
                raise TypeError(f"{annotation!r}: only `X | None` unions can cross a contract")
            return replace(cls.of(rest[0]), optional=True)
        if isinstance(origin, type) and issubclass(origin, Sequence):
            items = {cls.of(a) for a in args if a is not Ellipsis}
            if len(items) != 1 or next(iter(items)).is_list or next(iter(items)).optional:
                raise TypeError(f"{annotation!r}: a list in a contract holds one type, neither lists nor None")
            return replace(items.pop(), is_list=True)
        if annotation in (Any, dict) or origin is dict:
            return cls("any")
        if annotation in _NAME_OF:
            return cls(_NAME_OF[annotation])
        raise TypeError(f"{annotation!r} is not a contract type")

    def accepts(self, other: TypeRef) -> bool:
        """True when a value of type `other` may flow into this one.

        An int may flow into a float; `any` accepts and is accepted; a frame must agree where both name one;
        a value that may be absent may not flow into one that must be there.
        """
        if self.name == "any" or other.name == "any":
            return True
        if self.is_list != other.is_list or (other.optional and not self.optional):
            return False
        if self.name != other.name and not (self.name == "float" and other.name == "int"):
            return False
        return self.frame is None or other.frame is None or self.frame == other.frame

    def __str__(self) -> str:
        frame = f"[{self.frame}]" if self.frame else ""
        return f"{self.name}{frame}{'[]' if self.is_list else ''}{'?' if self.optional else ''}"


def _near(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
