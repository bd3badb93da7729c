"""Bad input: one clear line, exit code 1, and nothing half-written."""

import json
import resource
import subprocess
import sys
from pathlib import Path

import pytest

SAY = "Pick the alphabet soup and place it in the basket"
GROCERY = ("plan", "--task", "fulfill-grocery", "--say", SAY)


def refused(done, *words):
    assert done.code == 1, done.err
    assert done.out == ""
    assert done.lines[0].startswith("error: ") and len(done.lines) <= 2
    assert "Traceback" not in done.err
    for word in words:
        assert word in done.err


def tree(folder):
    return {p: p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file() and p.name != ".lock"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("plan", "--task", "fulfil-grocery", "--say", SAY), ["task 'fulfil-grocery'", "fulfill-grocery"]),
        ((*GROCERY, "--variant", "objekt"), ["variant 'objekt'", "object"]),
        ((*GROCERY, "--author", "poet"), ["author 'poet'", "symbolic"]),
        ((*GROCERY, "--provider", "nowhere.Tool=x"), ["tool 'nowhere.Tool'"]),
        ((*GROCERY, "--provider", "grounding_dino.Detect=gpu"), ["provider", "embedded"]),
        (("plan", "--task", "fulfill-grocery", "--say", "Pick the unicorn and place it in the basket"), ["unicorn"]),
        (("plan", "--task", "fulfill-grocery", "--say", ""), ["instruction"]),
        (("generate", "nope"), ["no run 'nope'"]),
        (("validate",), ["no run", "gap plan"]),
        (("report", "./nowhere"), ["nowhere"]),
        (("tools", "show", "gripper.Opne"), ["gripper.Open"]),
        (("tools", "show", "robot.open_gripper"), ["Did you mean 'gripper.Open'?"]),
        (("skills", "show", "transporting-objects"), ["Did you mean 'transport-to-drop'?"]),
        (("tasks", "show", "fulfill"), ["fulfill-grocery"]),
    ],
    ids=lambda v: " ".join(v)[:40] if isinstance(v, tuple) else "",
)
def test_what_does_not_exist_is_named_with_what_does(gap, tmp_path, arguments, words):
    refused(gap(*arguments), *words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        ("name: little\nname: little", "twice"),
        ("name: no", "boolean"),
        ("name: &x little", "anchor"),
        ("name:\tlittle", "YAML"),
        ("name: litt\u200ble", "invisible"),
        ("nmae: little", "nmae"),
        (b"name: l\xe4ttle", "UTF-8"),
    ],
)
@pytest.mark.parametrize(
    "command", [("tasks", "show", "little"), ("plan", "--task", "little", "--say", "Do it")], ids=lambda c: c[0]
)
def test_a_malformed_task_names_file_and_line(gap, little_cell, plugin_folder, tmp_path, damage, word, command):
    file = plugin_folder / "little_cell/tasks/little/task.yaml"
    good = file.read_bytes()
    bad = damage if isinstance(damage, bytes) else damage.encode()
    try:
        file.write_bytes(good.replace(b"name: little", bad, 1))
        refused(gap(*command), "task.yaml", word)
    finally:
        file.write_bytes(good)
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    ("name", "old", "new", "word"),
    [
        ("SKILL.md", "name: fake", "name: fake\nname: fake", "twice"),
        ("SKILL.md", "name: fake", "name: faked", "folder"),
        ("SKILL.md", "---\nname", "name", "frontmatter"),
        ("contract.yaml", "kind: composite", "kind: composit", "kind"),
        ("contract.yaml", "template: t.py.j2", "template: ../t.py.j2", "inside"),
        ("contract.yaml", "template: t.py.j2", "template: gone.j2", "gone.j2"),
    ],
)
def test_a_malformed_skill_is_left_out_with_its_plugin_and_file(gap, make_run, plugin_folder, name, old, new, word):
    make_run()
    file = plugin_folder / "little_cell/skills/fake" / name
    good = file.read_text()
    try:
        file.write_text(good.replace(old, new, 1))
        for command, code in (("skills list", 0), ("tools list", 0), ("skills show fake", 1), ("validate", 1)):
            done = gap(*command.split())
            assert done.code == code, (command, done.err)
            warned = [line for line in done.lines if line.startswith("warning: skill fake left out")]
            assert len(warned) == (command != "tools list")
            for said in warned:
                assert f"fake/{name}" in said and word in said and "plugin 'little_cell'" in said
    finally:
        file.write_text(good)


def test_a_malformed_task_leaves_the_other_tasks(gap, little_cell, plugin_folder):
    file = plugin_folder / "little_cell/tasks/little/task.yaml"
    good = file.read_text()
    try:
        file.write_text("name: [")
        done = gap("tasks", "list")
        assert done.code == 0 and "fulfill-grocery" in done.out and len(done.lines) == 1
        assert "task little left out" in done.err and "little/task.yaml" in done.err and "'little_cell'" in done.err
        assert gap(*GROCERY).code == 0
    finally:
        file.write_text(good)


@pytest.mark.parametrize("file", ["skills/fake/SKILL.md", "skills/fake/contract.yaml", "tasks/little/task.yaml"])
def test_a_byte_order_mark_is_harmless(gap, little_cell, plugin_folder, file):
    file = plugin_folder / "little_cell" / file
    good = file.read_bytes()
    try:
        file.write_bytes(b"\xef\xbb\xbf" + good)
        for arguments in (("skills", "show", "fake"), ("tasks", "show", "little")):
            done = gap(*arguments)
            assert done.code == 0 and done.err == ""
    finally:
        file.write_bytes(good)


@pytest.mark.parametrize("name", ["run.yaml", "plan/plan.json", "validate/findings.json", "generate/workflow.json"])
@pytest.mark.parametrize("damage", [b"", b"[", b"\xff\xfe", b"null", b"[1]"], ids=repr)
def test_a_damaged_run_is_refused_with_the_file(gap, make_run, name, damage):
    run = make_run()
    (run.path / name).write_bytes(damage)
    before = tree(run.path)
    done = gap("rehearse", "-n", 1, "--record", "none")
    assert done.code == 1 and "Traceback" not in done.err and done.out == ""
    assert Path(name).name in done.err or "validate" in done.err
    assert tree(run.path) == before


def test_a_dangling_reference_is_a_finding_not_a_crash(gap, make_run):
    run = make_run()
    file = run.path / "generate/workflow.json"
    file.write_text(
        file.read_text().replace(
            '"tool": "cell.Act"', '"tool": "cell.Act", "inputs": {"seconds": {"$ref": "look.nowhere"}}'
        )
    )
    done = gap("validate", "--json")
    assert done.code == 1 and "has no 'nowhere'" in done.out


def test_what_exists_is_listed_once_for_all_unknown_tools(gap, make_run):
    run = make_run()
    file = run.path / "generate/workflow.json"
    data = json.loads(file.read_text())
    nodes = data["subgraphs"]["main_sg"]["nodes"]
    for node in nodes.values():
        if node["type"] == "tool":
            node["tool"] = "xq.Zv"
    file.write_text(json.dumps(data))
    found = [f for f in json.loads(gap("validate", "--json").out)["findings"] if f["code"] == "K2"]
    assert len(found) > 1 and [f.get("hint", "").startswith("Known: ") for f in found] == [True] + [False] * (
        len(found) - 1
    )


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("raise ValueError('out of paint')", "out of paint"),
        ("import sys; sys.exit(4)", "SystemExit"),
        ("import nowhere_to_be_found", "nowhere_to_be_found"),
        ("def gap_register_tool(): pass", ""),
        ("print('hello from the plugin')", ""),
    ],
)
def test_a_bad_plugin_takes_nothing_along(gap, install, source, reason):
    install("bad_plugin", source)
    done = gap("tools", "list", "--json")
    assert done.code == 0 and len(json.loads(done.out)) > 30
    if reason:
        assert "warning: plugin bad_plugin left out" in done.err and reason in done.err


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.argv = ["gap", *sys.argv[2:]]
from gap_cli.main import main
main()
"""


def limited(size, *arguments):
    """Run gap where no file can grow beyond `size` bytes, as on a full disk."""
    command = [sys.executable, "-B", "-c", LIMITED, str(size), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def test_a_full_disk_leaves_no_run(tmp_path):
    assert hasattr(resource, "RLIMIT_FSIZE")
    done = limited(100, *GROCERY, "--root", tmp_path / "runs")
    assert done.returncode == 1 and done.stderr.startswith("error: Cannot write")
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == []


def test_a_disk_that_fills_up_leaves_the_stage_before(gap, tmp_path):
    assert gap(*GROCERY, "--root", tmp_path / "runs").code == 0
    before = tree(tmp_path / "runs")
    done = limited(4000, "generate", "--root", tmp_path / "runs")
    assert done.returncode == 1 and "half-written" in done.stderr
    assert tree(tmp_path / "runs") == before


def test_a_disk_full_for_the_rehearsal_keeps_the_one_before(gap, make_run):
    run = make_run()
    assert gap("rehearse", "-n", 1, "--record", "none").code == 0
    kept = {n: (run.folder("rehearse/00") / n).read_bytes() for n in ("episodes.jsonl", "summary.json", "feedback.md")}
    done = limited(1500, "rehearse", run.path, "-n", 8, "--record", "none")
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert {n: (run.folder("rehearse/00") / n).read_bytes() for n in kept} == kept


def test_a_disk_full_while_recording_leaves_no_part_of_a_recording(gap, make_run):
    run = make_run()
    done = limited(9000, "rehearse", run.path, "-n", 2, "--record", "all")
    assert done.returncode == 1 and ".mcap: " in done.stderr and "--record none" in done.stderr
    assert list(run.folder("rehearse/00").glob("*.mcap*")) == []


def test_a_worker_killed_while_recording_leaves_no_part_of_a_recording(gap, make_run, faults):
    run = make_run()
    faults(seed4="kill")
    done = gap("rehearse", "-n", 2, "--record", "all")
    assert done.code == 0 and "crashed" in done.out
    assert [p.name for p in run.folder("rehearse/00").glob("*.mcap*")] == ["seed-000003.mcap"]


def test_every_problem_of_a_task_is_told_by_check_and_by_plan(gap, little_cell, plugin_folder):
    file = plugin_folder / "little_cell/tasks/little/task.yaml"
    good = file.read_text()
    bad = good.replace("mass: 0.1", "mass: 0").replace('w.body("{target}").x', 'w.body("{target}").xx')
    words = ["objects.can.mass: 0 should be greater", "success.right: ", "no 'xx'", "2 problems"]
    try:
        file.write_text(bad)
        checked = gap("tasks", "check", file)
        planned = gap("plan", "--task", "little", "--say", "Do it")
        told = json.loads(gap("tasks", "check", file.parent, "--json").out)
    finally:
        file.write_text(good)
    assert checked.code == planned.code == 1 and len(told) == 2
    for text in (checked.out, planned.err):
        assert all(word in text for word in words), text
    assert gap("tasks", "check", file).out == "1 checked, 0 problems\n"
