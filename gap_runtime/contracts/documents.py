"""Strict reading of YAML and JSON: what a lenient parser would guess at is an error here, with its line.

YAML traps refused: duplicate keys, aliases, tabs, `no`/`yes`/`on`/`off` as booleans, sexagesimal, octal and date
scalars, `1e3` (text to YAML 1.1), non-string keys, non-UTF-8, invisible characters, several documents, tags, nesting
deeper than `MAX_DEPTH`. JSON likewise: duplicate keys, NaN and Infinity, 65-bit integers, half surrogates, nesting.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import yaml

from gap_runtime.contracts.failures import DocumentError

MAX_DEPTH = 64
MAX_BYTES = 8_000_000
MAX_YAML = 1_000_000  # a person writes less, and the strict loader reads about 1 MB in ten seconds
_AMBIGUOUS_BOOL = {"yes", "no", "on", "off", "y", "n"}
_SEXAGESIMAL = re.compile(r"^[-+]?\d+(:[0-5]?\d)+(\.\d*)?$")
_DECIMAL = re.compile(r"^[-+]?(0|[1-9][0-9]*)$")
_TEXT_NUMBER = re.compile(r"^[-+]?(0|[1-9][0-9]*)(\.[0-9]*)?[eE][-+]?[0-9]+$")
_CONTROL = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x84\x86-\x9f\xad\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)
_PLAIN_FLOAT = re.compile(r"\.(inf|nan)$", re.IGNORECASE)
_SURROGATE = re.compile("[\ud800-\udfff]")
INT64 = range(-(2**63), 2**63)


def read_text(path: Path) -> str:
    """The file's text. Raises `DocumentError` when it is missing, unreadable, too large or not clean UTF-8."""
    where = str(path)
    try:
        if not path.is_file():
            raise DocumentError(where, "is not a file" if path.exists() else "no such file")
        if path.stat().st_size > MAX_BYTES:
            raise DocumentError(where, f"larger than {MAX_BYTES // 1_000_000} MB")
        data = path.read_bytes()
    except OSError as error:
        raise DocumentError(where, f"cannot be read ({error.strerror})") from None
    try:
        text = data.decode("utf-8").removeprefix("\ufeff")  # a byte-order mark says UTF-8, and nothing else
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise DocumentError(f"{where}:{line}", "is not UTF-8", hint="Save the file as UTF-8.") from None
    return check_text(text, where)


def check_text(text: str, where: str) -> str:
    """Refuse control, zero-width and bidirectional characters, which hide what a reviewer would see."""
    found = _CONTROL.search(text)
    if found:
        line = text.count("\n", 0, found.start()) + 1
        raise DocumentError(f"{where}:{line}", f"holds the invisible character U+{ord(found[0]):04X}")
    return text


def ambiguous(text: str) -> bool:
    """True for a word that the strict reader accepts only in quotes although YAML 1.1 would call it text."""
    return text.lower() in _AMBIGUOUS_BOOL or bool(_TEXT_NUMBER.match(text) or _SEXAGESIMAL.match(text))


class _StrictLoader(yaml.SafeLoader):
    """SafeLoader that refuses what YAML 1.1 would silently reinterpret."""

    where = "yaml"
    depth = 0

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.keys: set[int] = set()  # nodes that are keys: there `y` can only be a word

    def refuse(self, node: Any, problem: str, hint: str = "") -> NoReturn:
        """Raise with the line of the node or event."""
        raise DocumentError(f"{self.where}:{node.start_mark.line + 1}", problem, hint=hint)

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None):
            self.refuse(event, "uses an anchor or alias", "Write the value out.")
        if getattr(event, "tag", None) is not None:
            self.refuse(event, f"uses the tag {event.tag}", "Write the plain value.")
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self.refuse(event, f"is nested deeper than {MAX_DEPTH} levels")
        try:
            return super().compose_node(parent, index)
        finally:
            self.depth -= 1

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        if isinstance(node, yaml.MappingNode):
            seen: set[str] = set()
            self.keys.update(id(key) for key, _ in node.value)
            for key, _ in node.value:
                if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
                    self.refuse(key, f"key {getattr(key, 'value', '?')!r} is not text", "Quote it.")
                if key.value in seen:
                    self.refuse(key, f"key {key.value!r} appears twice")
                seen.add(key.value)
        elif isinstance(node, yaml.ScalarNode):
            found = _CONTROL.search(node.value)
            if found:
                self.refuse(node, f"holds the invisible character U+{ord(found[0]):04X}")
            if node.style is None:
                self._check_plain(node)
        return super().construct_object(node, deep)

    def _check_plain(self, node: yaml.ScalarNode) -> None:
        text, kind = node.value, node.tag.rpartition(":")[2]
        if text.lower() in _AMBIGUOUS_BOOL and id(node) not in self.keys:
            self.refuse(node, f"{text} could mean a boolean or a word", f'Write "{text}" or true/false.')
        if kind == "timestamp" or _SEXAGESIMAL.match(text):
            self.refuse(node, f"{text} would be read as a time", f'Write "{text}".')
        if kind == "int" and not _DECIMAL.match(text):
            self.refuse(node, f"{text} is not a decimal integer", f'Write it in decimal, or "{text}" for a word.')
        if kind == "int" and (len(text) > 20 or int(text) not in INT64):
            self.refuse(node, f"{text[:24]} does not fit into 64 bits")
        if kind == "str" and _TEXT_NUMBER.match(text):
            self.refuse(node, f"{text} would be read as text", "Write a point and a sign, as in 1.0e+3.")
        if kind == "float" and ("_" in text or not math.isfinite(float(_PLAIN_FLOAT.sub(r"\1", text)))):
            self.refuse(node, f"{text} is not a finite decimal number")


class _TextLoader(_StrictLoader):
    """Every scalar is the text that is written, as in the Agent Skills format: `1.0`, `no` and `null` included."""

    yaml_implicit_resolvers: dict[Any, Any] = {}

    def _check_plain(self, node: yaml.ScalarNode) -> None:
        pass


def parse_yaml(text: str, where: str, *, text_only: bool = False) -> Any:
    """Strictly parse one YAML document; with `text_only` every scalar is text. Raises `DocumentError` with the line."""
    if len(text) > MAX_YAML:
        raise DocumentError(where, f"is longer than {MAX_YAML // 1_000_000} MB")
    loader = (_TextLoader if text_only else _StrictLoader)(check_text(text, where))
    loader.where = where
    try:
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        hint = "Indent with spaces." if "\\t" in str(error) else ""
        raise DocumentError(f"{where}{line}", f"is not YAML: {error.problem or error}", hint=hint) from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise DocumentError(where, f"is not YAML: {type(error).__name__}") from None
    finally:
        loader.dispose()


def yaml_lines(text: str) -> dict[str, int]:
    """The line of every key of a YAML document that `parse_yaml` accepts, by dotted path."""
    found: dict[str, int] = {}
    stack = [("", yaml.compose(text, Loader=yaml.SafeLoader))]
    while stack:
        path, node = stack.pop()
        pairs = node.value if isinstance(node, yaml.MappingNode) else ()
        items = [(key.value, key, value) for key, value in pairs]
        if isinstance(node, yaml.SequenceNode):
            items = [(str(i), value, value) for i, value in enumerate(node.value)]
        for name, key, value in items:
            found[f"{path}{name}"] = key.start_mark.line + 1
            stack.append((f"{path}{name}.", value))
    return found


def located(error: DocumentError, lines: Mapping[str, int]) -> DocumentError:
    """The error with the line before each of its problems, which begin with a dotted path."""

    def line_of(problem: str) -> int:
        path = problem.partition(": ")[0]
        while path and path not in lines:
            path = path.rpartition(".")[0]
        return lines.get(path, 0)

    problems = sorted((line_of(problem), problem) for problem in error.problems)
    texts = [f"line {line}: {problem}" if line else problem for line, problem in problems]
    return DocumentError(error.where, *texts, hint=error.hint)


def parse_json(text: str, where: str) -> Any:
    """Strictly parse one JSON document. Raises `DocumentError`."""

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        out: dict[str, Any] = {}
        for key, value in items:
            if key in out:
                raise DocumentError(where, f"key {key!r} appears twice")
            out[key] = value
        return out

    def constant(name: str) -> NoReturn:
        raise DocumentError(where, f"{name} is not a finite number")

    def number(text: str) -> float:
        value = float(text)
        return value if math.isfinite(value) else constant(text[:24])

    def integer(text: str) -> int:
        if len(text) > 20 or int(text) not in INT64:
            raise DocumentError(where, f"{text[:24]} does not fit into 64 bits")
        return int(text)

    try:
        data = json.loads(text, object_pairs_hook=pairs, parse_constant=constant, parse_float=number, parse_int=integer)
    except json.JSONDecodeError as error:
        raise DocumentError(f"{where}:{error.lineno}", f"is not JSON: {error.msg}") from None
    except (RecursionError, ValueError) as error:
        raise DocumentError(where, f"is not JSON: {type(error).__name__}") from None
    _check_tree(data, where)
    return data


def _check_tree(data: Any, where: str) -> None:
    """Refuse what parsed but would break whoever walks or writes it: depth, and halves of surrogate pairs."""
    layer, depth = [data], 0
    while layer:
        depth += 1
        if depth > MAX_DEPTH:
            raise DocumentError(where, f"is nested deeper than {MAX_DEPTH} levels")
        below: list[Any] = []
        for item in layer:
            if isinstance(item, dict):
                below.extend(item)
                below.extend(item.values())
            elif isinstance(item, list):
                below.extend(item)
            elif isinstance(item, str) and not item.isascii() and _SURROGATE.search(item):
                raise DocumentError(where, "holds half of a surrogate pair")
        layer = below


def read_yaml(path: Path) -> Any:
    """Strictly read a YAML file."""
    return parse_yaml(read_text(path), str(path))


def read_json(path: Path) -> Any:
    """Strictly read a JSON file."""
    return parse_json(read_text(path), str(path))
