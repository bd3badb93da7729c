import json
import shlex

import pytest

from gap_cli import __version__
from gap_cli.main import app
from tests.unit.test_architecture import heavy_modules_after

GROUPS = [g.typer_instance.info.name for g in app.registered_groups]
COMMANDS = [c.name or c.callback.__name__ for c in app.registered_commands] + GROUPS


def test_help_names_every_verb(gap):
    out = gap("--help").out
    assert all(name in out for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_verb_explains_itself(gap, name):
    done = gap(name, "--help")
    assert done.code == 0 and "Usage: gap" in done.out


def test_version(gap):
    assert gap("--version").out.split() == ["gap", __version__]


@pytest.mark.parametrize(
    "arguments",
    [
        *((group, "list") for group in GROUPS),
        ("tools", "show", "cell.Act"),
        ("tasks", "show", "little"),
        ("skills", "show", "fake"),
    ],
    ids=" ".join,
)
def test_json_is_the_only_thing_on_stdout(gap, little_cell, arguments):
    done = gap(*arguments, "--json")
    assert done.code == 0 and done.err == ""
    assert json.loads(done.out)


def test_tools_say_who_serves_them(gap, little_cell):
    listed = {t["name"]: t for t in json.loads(gap("tools", "list", "--json").out)}
    assert (listed["cell.Act"]["provider"], listed["cell.Act"]["plugin"]) == ("embedded", "little_cell")
    assert "little_cell" in gap("tools", "list").out


def test_the_verbs_after_generate_work_on_the_latest_run_or_the_named_one(gap, make_run):
    run = make_run()
    for name in ([], [run.name], [run.path]):
        assert gap("validate", *name).code == 0
        assert gap("rehearse", *name, "-n", 1, "--record", "none").code == 0
        done = gap("report", *name, "--json")
        assert json.loads(done.out)["run"] == run.name


def test_each_stage_says_what_to_type_next(gap, make_run):
    run = make_run()
    assert f"gap rehearse {run.name}" in gap("validate").out
    assert f"gap report {run.name}" in gap("rehearse", "-n", 1, "--record", "none").out


def test_a_run_elsewhere_is_named_by_a_path_the_shell_takes(gap, make_run, tmp_path):
    run = make_run(tmp_path / "else where")
    next_line = gap("validate", "--root", tmp_path / "else where").out.splitlines()[-1]
    assert shlex.split(next_line) == ["next:", "gap", "rehearse", str(run.path)]


def test_rehearse_prints_rate_interval_and_times(gap, make_run):
    make_run()
    out = gap("rehearse", "-n", 2, "--record", "none").out
    for word in ("success", "95 % interval", "cycle time", "motion", "compute", "wall time"):
        assert word in out


def test_a_refused_graph_exits_1_and_lists_the_findings(gap, make_run):
    run = make_run()
    file = run.path / "generate/workflow.json"
    file.write_text(file.read_text().replace("cell.Act", "cell.Actt"))
    done = gap("validate", "--json")
    found = json.loads(done.out)
    assert done.code == 1 and not found["valid"]
    assert any("cell.Actt" in f["message"] for f in found["findings"])
    assert json.loads((run.path / "validate/findings.json").read_text())["findings"] == found["findings"]
    assert gap("rehearse", "-n", 1).code == 1


def test_a_rehearsal_that_measured_nothing_exits_1_and_says_so(gap, make_run, faults):
    make_run()
    faults(seed3="segv", seed4="segv")
    done = gap("rehearse", "-n", 2, "--record", "none")
    assert done.code == 1 and "Nothing was measured: all 2 episodes are void (2 x died of SIGSEGV)" in done.err
    assert gap("rehearse", "-n", 3, "--record", "none").code == 0


@pytest.mark.parametrize("arguments", [("rehearse", "-n", "1", "--record", "none"), ("tasks", "show", "little")])
def test_only_workers_load_the_simulator(make_run, arguments):
    run = make_run()
    named = (str(run.path),) if arguments[0] == "rehearse" else ()
    assert heavy_modules_after([*arguments, *named]) == ["0"]
