"""`gap skills new`: a pip-installable plugin with one skill, one tool and a test, ready to be made one's own."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Container
from importlib import metadata
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from gap_runtime.contracts.names import name_problem
from gap_runtime.errors import BadRequestError, StorageError

TEMPLATES = Path(__file__).parent / "templates" / "plugin"
SUFFIX = ".j2"
MAX_NAME = 50  # the skill format allows 64; the package name adds a prefix


def new_plugin(name: str, into: Path, skills: Container[str] = ()) -> list[Path]:
    """Write the plugin into the new folder `into`/`name`; returns the files, sorted.

    Raises `BadRequestError` for a name no skill can have and for one that is taken: by one of `skills`, or by an
    installed package, which the new one would replace. `StorageError` when the folder exists or cannot be written.
    """
    problem = name_problem(name, "-", MAX_NAME)
    if problem:
        raise BadRequestError("name", problem, hint="Write for example wave-hello.")
    taken = f"there is a skill {name}" if name in skills else _installed(f"gap-{name}")
    if taken:
        raise BadRequestError("name", f"{name!r} is taken: {taken}.", hint="Choose another name.")
    root = into / name
    files = {root / path: text for path, text in _render(name).items()}
    try:
        into.mkdir(parents=True, exist_ok=True)
        root.mkdir()
        for file, text in files.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    except FileExistsError:
        raise StorageError(f"{root} exists already.", hint="Choose another name, or remove it.") from None
    except OSError as error:
        raise StorageError(f"{root} cannot be written ({error.strerror}).") from None
    return sorted(files)


def _installed(distribution: str) -> str:
    """What is installed under the names of a new plugin, or ''."""
    package = distribution.replace("-", "_")
    with contextlib.suppress(metadata.PackageNotFoundError):
        return f"{distribution} {metadata.version(distribution)} is installed"
    return f"the module {package} is installed" if importlib.util.find_spec(package) else ""


def _render(name: str) -> dict[str, str]:
    """Relative path to text of every file. The templates hold templates themselves, hence the [[ ]] of their own."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False,
        variable_start_string="[[", variable_end_string="]]", block_start_string="[%", block_end_string="%]",
        comment_start_string="[##", comment_end_string="##]",
    )  # fmt: skip
    snake = name.replace("-", "_")
    title = name.replace("-", " ").capitalize()
    words = {"name": name, "snake": snake, "package": f"gap_{snake}", "title": title}
    folders = {"package": words["package"], "package/skill": f"{words['package']}/skills/{name}"}
    found: dict[str, str] = {}
    for template in sorted(environment.list_templates()):
        path = template.removesuffix(SUFFIX)
        for folder in sorted(folders, key=len, reverse=True):
            if path.startswith(f"{folder}/"):
                path = folders[folder] + path.removeprefix(folder)
                break
        found[path] = environment.get_template(template).render(**words)
    return found
