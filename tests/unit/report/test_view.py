"""`gap view`: the graph alone before a run, with what happened after one."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from gap_cli.main import app
from gap_cli.rehearse.single_run import run_once
from gap_cli.report.view import read_view
from gap_runtime.contracts.failures import DocumentError
from gap_runtime.errors import RunError


def view(run, *arguments):
    done = CliRunner().invoke(app, ["view", str(run.path), *arguments])
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_graph_that_never_ran_is_drawn(make_run):
    run = make_run()
    text = view(run)
    assert "look" in text and "✓" not in text
    assert 'data-path="main/look"' in (run.path / "view.html").read_text()
    assert (run.path / "graph.mmd").read_text() == view(run, "--mermaid")


def test_the_last_run_is_told(make_run):
    run = make_run()
    run_once(run, dry=True)
    assert "✓ look" in view(run)
    assert json.loads(view(run, "--json"))["last_run"] == "success"
    assert '"status":"finished"' in (run.path / "view.html").read_text()


def test_the_film_stands_in_the_page(make_run):
    run = make_run()
    run_once(run, video=True)
    shown = read_view(run)
    shown.write()
    assert shown.film is not None and "data:video/webm;base64," in (run.path / "view.html").read_text()


def test_a_damaged_trace_is_one_clear_error(make_run):
    run = make_run()
    run_once(run, dry=True)
    (run.folder("run") / "trace.jsonl").write_text("{")
    with pytest.raises(DocumentError, match="is not a trace"):
        read_view(run)


def test_a_run_without_a_graph_says_what_to_type(make_run):
    run = make_run()
    (run.path / "generate/workflow.json").unlink()
    with pytest.raises(RunError, match="gap generate"):
        read_view(run)
