"""Skills on disk: what is accepted, and that every trap is refused with the file it is in."""

from __future__ import annotations

import os
import shutil

import pytest

from gap_cli.skills import load_bundle, load_library, parse_skill_md
from gap_runtime.errors import DocumentError, PluginError, UnknownNameError

HEAD = (
    "---\nname: pour-cup\ndescription: Pours. Use when a cup is empty.\nmetadata:\n  gap-contract: contract.yaml\n---\n"
)
CONTRACT = """
kind: composite
roles: [target]
inputs: {target_obb: "OrientedBoundingBox[world]"}
exits: {success: {poured: the cup is full}, failure: failed}
needs: [hand_empty]
effects: [full(target)]
scripts: {tilt: scripts/tilt.py}
references: {angles: references/angles.md}
template: templates/subgraph.py.j2
"""


@pytest.fixture
def skill(tmp_path):
    root = tmp_path / "pour-cup"
    for folder in ("scripts", "references", "templates"):
        (root / folder).mkdir(parents=True)
    (root / "SKILL.md").write_text(HEAD + "# pour-cup\n")
    (root / "contract.yaml").write_text(CONTRACT)
    (root / "scripts" / "tilt.py").write_text("def run(ctx) -> None: ...\n")
    (root / "references" / "angles.md").write_text("# angles\n")
    (root / "templates" / "subgraph.py.j2").write_text("sg = None\n")
    return root


def test_a_bundle_says_what_its_files_say(skill):
    bundle = load_bundle(skill, "cups")
    assert (bundle.name, bundle.plugin, bundle.body) == ("pour-cup", "cups", "# pour-cup")
    assert bundle.contract.effects == ["full(target)"]
    assert bundle.scripts == {"tilt": skill / "scripts" / "tilt.py"}
    assert len(bundle.files) == 5


def test_digest_follows_the_bytes(skill):
    before = load_bundle(skill).digest
    assert load_bundle(skill).digest == before
    (skill / "scripts" / "tilt.py").write_text("def run(ctx) -> int: ...\n")
    assert load_bundle(skill).digest != before


def test_windows_line_ends_are_read(skill):
    (skill / "SKILL.md").write_bytes((HEAD + "body\n").replace("\n", "\r\n").encode())
    assert load_bundle(skill).body == "body"


def test_fences_in_the_body_are_text(skill):
    (skill / "SKILL.md").write_text(HEAD + "a\n\n---\n\nb\n")
    assert load_bundle(skill).body == "a\n\n---\n\nb"


def head(**changes):
    keys = {"name": "pour-cup", "description": "Pours.", **changes}
    lines = "".join(f"{k}: {v}\n" for k, v in keys.items() if v is not None)
    return f"---\n{lines}metadata:\n  gap-contract: contract.yaml\n---\nbody\n"


TRAPS = {
    "empty file": ("", "does not start with frontmatter"),
    "no frontmatter": ("# pour-cup\n", "does not start with frontmatter"),
    "never closed": ("---\nname: pour-cup\n", "never closed"),
    "no body": (head().removesuffix("body\n"), "no text below"),
    "not a mapping": ("---\n- a\n---\nbody\n", "must be a mapping"),
    "two documents": ("---\nname: a\n--- \nx: y\n---\nbody\n", "description"),
    "duplicate key": ("---\nname: pour-cup\nname: pour-cup\n---\nbody\n", "twice"),
    "anchor": (head(license="&x MIT"), "anchor"),
    "alias": (head(license="*x"), "alias"),
    "python object": (head(license="!!python/name:os.system x"), "tag"),
    "custom tag": (head(license="!mit x"), "tag"),
    "flow style": (head(license="{a: b}"), "flow style"),
    "tab": ("---\nname: pour-cup\n\tdescription: x\n---\nbody\n", "not YAML"),
    "fence in a value": (head(description='"a --- b"'), "---"),
    "unknown key": (head(version='"1"'), "not a known key"),
    "name no": (head(name="no"), "differs from its folder"),
    "name a number": (head(name="7"), "should be words of lower-case"),
    "name null": (head(name="null"), "differs from its folder"),
    "name missing": (head(name=None), "name"),
    "name upper case": (head(name="Pour-Cup"), "should be words"),
    "name with a path": (head(name="../pour-cup"), "should be words"),
    "name double hyphen": (head(name="pour--cup"), "should be words"),
    "name homoglyph": (head(name="pоur-cup"), "should be words"),
    "name too long": (head(name="a" * 65), "64"),
    "name of another folder": (head(name="pour-mug"), "differs from its folder"),
    "description blank": (head(description='"  "'), "must say"),
    "description too long": (head(description="a" * 1025), "1024"),
    "zero width": (head(description="a\u200bb"), "U+200B"),
    "right-to-left override": (head(description="a\u202eb"), "U+202E"),
    "NUL": (head(description="a\0b"), "U+0000"),
    "byte order mark inside": (head(description="a\ufeffb"), "U+FEFF"),
    "no contract": ("---\nname: pour-cup\ndescription: x\n---\nbody\n", "gap-contract"),
    "metadata not text": (head().replace("contract.yaml", "\n    - contract.yaml"), "line 5: metadata.gap-contract"),
}


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_refused_with_its_file(skill, trap):
    text, says = TRAPS[trap]
    (skill / "SKILL.md").write_text(text)
    with pytest.raises(DocumentError) as caught:
        load_bundle(skill)
    assert says in str(caught.value)
    assert caught.value.where.startswith(str(skill / "SKILL.md"))


@pytest.mark.parametrize("data", [head().encode("utf-16"), head(description="caf\xe9").encode("latin-1")])
def test_other_encodings_are_refused(skill, data):
    (skill / "SKILL.md").write_bytes(data)
    with pytest.raises(DocumentError, match="UTF-8"):
        load_bundle(skill)


def test_the_line_is_the_line_of_the_file():
    with pytest.raises(DocumentError) as caught:
        parse_skill_md("---\nname: x\ndescription: y\nname: x\n---\nbody\n", "SKILL.md")
    assert caught.value.where == "SKILL.md:4"


PATHS = [
    "../outside.py",
    "/etc/passwd",
    "~/x.py",
    "a//b.py",
    "scripts/ tilt.py",
    "https://x/y.py",
    "a\\b.py",
    "missing.py",
]


@pytest.mark.parametrize("path", PATHS)
def test_a_script_outside_or_missing_is_refused(skill, path):
    (skill / "contract.yaml").write_text(CONTRACT.replace("scripts/tilt.py", repr(path)))
    with pytest.raises(DocumentError):
        load_bundle(skill)


@pytest.mark.parametrize("victim", ["SKILL.md", "contract.yaml", "scripts/tilt.py", "scripts"])
def test_symbolic_links_are_refused(skill, victim):
    link = skill / victim
    link.rename(skill.parent / "real")
    link.symlink_to(skill.parent / "real")
    with pytest.raises(DocumentError, match="symbolic link"):
        load_bundle(skill)


def test_a_folder_or_a_pipe_is_no_file(skill):
    (skill / "SKILL.md").unlink()
    (skill / "SKILL.md").mkdir()
    with pytest.raises(DocumentError, match="not a plain file"):
        load_bundle(skill)
    (skill / "SKILL.md").rmdir()
    os.mkfifo(skill / "SKILL.md")
    with pytest.raises(DocumentError, match="not a plain file"):
        load_bundle(skill)


def test_a_binary_script_is_refused(skill):
    (skill / "scripts" / "tilt.py").write_bytes(b"\x7fELF\x00\xff")
    with pytest.raises(DocumentError, match=r"tilt\.py"):
        load_bundle(skill)


def test_a_bad_contract_names_its_key(skill):
    (skill / "contract.yaml").write_text(CONTRACT + "cots: 2\n")
    with pytest.raises(DocumentError, match=r"contract\.yaml.*cots"):
        load_bundle(skill)


@pytest.mark.parametrize("fact", ["full target", "full(target", "full(cup)", "Full(target)"])
def test_a_malformed_fact_is_refused(skill, fact):
    (skill / "contract.yaml").write_text(CONTRACT.replace("full(target)", f'"{fact}"'))
    with pytest.raises(DocumentError, match=r"contract\.yaml.*full|contract\.yaml.*Full"):
        load_bundle(skill)


def test_a_need_cannot_be_negative(skill):
    (skill / "contract.yaml").write_text(CONTRACT.replace("[hand_empty]", '["-hand_empty"]'))
    with pytest.raises(DocumentError, match="only facts that hold"):
        load_bundle(skill)


def test_library_finds_both_spellings(skill):
    library = load_library([(skill.parent, "cups")])
    assert list(library) == ["pour-cup"]
    assert library["pour_cup"] is library["pour-cup"]
    assert "pour_cup" in library
    with pytest.raises(UnknownNameError, match="pour-cup"):
        library.find("pour-cap")


def test_library_takes_one_skill_or_a_folder_of_them(skill):
    (skill.parent / "__pycache__").mkdir()
    (skill.parent / "notes").mkdir()
    assert list(load_library([(skill, "a")])) == list(load_library([(skill.parent, "a")]))


def test_two_skills_of_one_name_name_both_plugins(skill, tmp_path):
    other = tmp_path / "b" / "pour-cup"
    other.parent.mkdir()
    shutil.copytree(skill, other)
    with pytest.raises(PluginError, match=r"(?=.*'cups')(?=.*'mugs')"):
        load_library([(skill, "cups"), (other, "mugs")])


@pytest.mark.parametrize("make", ["nothing", "file", "empty"])
def test_a_registered_path_without_skills_is_left_out(tmp_path, make, caplog):
    path = tmp_path / "x"
    if make == "file":
        path.write_text("")
    elif make == "empty":
        path.mkdir()
    assert list(load_library([(path, "cups")]).left_out) == ["x"]
    assert str(path) in caplog.text and "'cups'" in caplog.text


def test_a_contract_without_its_skill_md_is_left_out_and_named(skill):
    (skill / "SKILL.md").unlink()
    with pytest.raises(PluginError, match=r"does not exist \(plugin 'cups'\)"):
        load_library([(skill.parent, "cups")]).find("pour-cup")
