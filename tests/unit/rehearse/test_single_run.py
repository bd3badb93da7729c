"""`gap run`: one run, in a world or dry, with faults, kept for `gap view`."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from gap_cli.main import app
from gap_cli.rehearse.single_run import run_once
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.errors import RunError


def kept(run):
    return sorted(p.name for p in run.folder("run").iterdir())


def trace(run):
    return [json.loads(line) for line in (run.folder("run") / "trace.jsonl").read_text().splitlines()]


def test_a_run_in_a_world_is_judged_and_traced(make_run):
    run = make_run()
    ended = run_once(run, seed=3)
    assert ended.data["dry"] is False and ended.data["claimed"] is True
    assert ended.success == (ended.data["instance"]["can"][0] > -0.03)
    assert trace(run)[0]["schema"] == "gap/trace/v1"
    assert [r["path"] for r in trace(run) if r.get("kind") == "node_finished"] == ["main/look", "main/act", "main/done"]
    assert kept(run) == ["result.json", "trace.jsonl"]


def test_the_result_is_a_function_of_the_seed_and_holds_no_clock(make_run):
    one, two = make_run(), make_run()
    for run in (one, two):
        run_once(run, seed=5)
    texts = [(r.folder("run") / "result.json").read_text() for r in (one, two)]
    assert texts[0] == texts[1] and "duration" not in texts[0]
    assert run_once(make_run(), seed=6).data["instance"] != json.loads(texts[0])["instance"]


def test_a_dry_run_needs_neither_a_world_nor_a_valid_graph(make_run):
    run = make_run()
    (run.path / "validate/findings.json").unlink()
    with pytest.raises(RunError, match="validate"):
        run_once(run)
    ended = run_once(run, dry=True)
    assert ended.success and ended.data["dry"] is True and "instance" not in ended.data


@pytest.mark.parametrize("dry", [True, False])
def test_faults_asked_for_are_injected(make_run, tmp_path, dry):
    rules = tmp_path / "rules.yaml"
    rules.write_text("rules:\n  - node: '*/act'\n    raise: {kind: grasp, code: slipped, message: it slipped}\n")
    ended = run_once(make_run(), dry=dry, rules=rules)
    assert not ended.success and "it slipped" in (ended.data.get("error") or ended.data["reason"])


def test_a_rules_file_that_is_not_there_is_one_clear_error(make_run, tmp_path):
    run = make_run()
    with pytest.raises(DocumentError, match="no such file"):
        run_once(run, dry=True, rules=tmp_path / "none.yaml")
    assert not run.folder("run").exists()


def test_a_film_is_kept_and_said_where_it_begins(make_run):
    run = make_run()
    run_once(run, video=True)
    assert kept(run) == ["result.json", "trace.jsonl", "video.webm"]
    film = trace(run)[0]["film"]
    assert film["video"] == "video.webm" and 0 <= film["began"] <= 0.2
    run_once(run)
    assert kept(run) == ["result.json", "trace.jsonl"]


@pytest.mark.parametrize("arguments, code", [(["--dry"], 0), (["--seed", "3"], 1), (["--dry", "--json"], 0)])
def test_the_exit_code_says_how_it_went(make_run, monkeypatch, arguments, code):
    run = make_run()
    if code:
        monkeypatch.setenv("CELL_FAULTS", '{"3": "slip"}')
    done = CliRunner().invoke(app, ["run", str(run.path), *arguments])
    assert done.exit_code == code, done.output
    if "--json" in arguments:
        assert json.loads(done.stdout)["result"]["status"] == "success"
    else:
        assert ("✓ main/look" in done.stdout) and ("gap view" in done.stdout)
    assert ("The jaws closed on nothing" in done.stdout) == bool(code)
