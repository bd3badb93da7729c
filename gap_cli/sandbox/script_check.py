"""Checks scripts that will run in the jail, before anything moves: what their text may not say, and if they load."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from gap_cli.sandbox.lint import NO_IMPORT, SCRIPT, importable, lint
from gap_cli.sandbox.scripts import ScriptJail
from gap_runtime.errors import GapError

_PATH = re.compile(r" \(/[^)]*\)")  # where this machine keeps a module is of no use to a reader


class ScriptProblem(NamedTuple):
    """What is wrong with one script. `line` is None where no single line is to be changed."""

    file: str
    line: int | None
    message: str
    hint: str = ""


def check_scripts(scripts: Mapping[str, str]) -> list[ScriptProblem]:
    """Every problem of scripts given by file name: no Python, an import that the jail has not, a name it does not
    offer; where a script has none of these, what goes wrong when its module is executed in the jail. Nothing is called.
    """
    found = [problem for name, text in scripts.items() for problem in _static_problems(name, text)]
    faulty = {problem.file for problem in found}
    clean = {name: text for name, text in scripts.items() if name not in faulty}
    if clean:
        with ScriptJail() as jail:
            for name, text in clean.items():
                try:
                    jail.load(text, name.rpartition("/")[2])
                except GapError as error:
                    found.append(
                        ScriptProblem(name, getattr(error, "line", None), _PATH.sub("", error.message), error.hint)
                    )
    return found


def _static_problems(name: str, text: str) -> Iterator[ScriptProblem]:
    try:
        compile(text, name, "exec", dont_inherit=True)
        problems = lint(text, SCRIPT, name)
    except SyntaxError as error:
        yield ScriptProblem(name, error.lineno, f"is not Python: {error.msg}")
        return
    except (ValueError, RecursionError, MemoryError) as error:
        yield ScriptProblem(name, None, f"is not Python: {type(error).__name__}")
        return
    for line, message in problems:
        yield ScriptProblem(name, line, message, importable(SCRIPT) if message.endswith(NO_IMPORT) else "")
