"""Things untrusted code tries, read from payloads/*.txt.

A payload is `## name | ends [| fires]` and its code. `ends` are the causes it may end with; `value` means that it
returns something harmless. `fires` marks what does reach CANARY (a path) or PORT (a listening socket) where the
system-call filter is off: these show that it is the filter which holds. A line `@expression` is code made by Python.
"""

import ast
import re
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent / "payloads"


class Payload(NamedTuple):
    name: str
    code: str
    ends: tuple[str, ...]
    fires: bool = False


def read(name):
    """The payloads of one file."""
    chunks = re.split(r"^## ", (FOLDER / f"{name}.txt").read_text(), flags=re.MULTILINE)[1:]
    return [parse(*chunk.split("\n", 1)) for chunk in chunks]


def parse(head, code):
    name, ends, *fires = (part.strip() for part in head.split("|"))
    code = code.rstrip()
    if code.startswith("@"):
        code = eval(compile(ast.parse(code[1:], mode="eval"), name, "eval"))
    return Payload(name, code, tuple(ends.split()), bool(fires))
