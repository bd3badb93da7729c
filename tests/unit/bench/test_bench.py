"""`gap bench`: each benchmark runs and tells what it measured; how fast is not a test's business."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from gap_cli.bench import timing
from gap_cli.bench.context import BenchRun, quiet
from gap_cli.bench.graph import run as graph
from gap_cli.bench.report import as_data, markdown, picture_files
from gap_cli.main import app
from gap_runtime.contracts.bench import BenchReport, Picture, Table
from gap_runtime.errors import UnknownNameError
from gap_runtime.plugins import Registry, load_registry


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(timing, "ROUND_S", 1e-6)


def once(watch=quiet, n=1):
    return BenchRun(Registry(), n=n, watch=watch)


def bench(*arguments, code=0):
    done = CliRunner().invoke(app, ["bench", *arguments])
    assert done.exit_code == code, done.output
    return done


@pytest.mark.parametrize("name, subjects", [("graph", "GaP"), ("validate", "validate"), ("jail", "start")])
def test_each_benchmark_gives_a_table_with_what_is_behind_it(tmp_path, name, subjects):
    data = json.loads(bench(name, "-n", "1", "--json", "--to", str(tmp_path)).stdout)
    assert data["schema"] == "gap/bench/v1" and data["command"] == f"gap bench {name} -n 1"
    assert any(str(row[0]).startswith(subjects) for row in data["rows"])
    assert all(len(row) == len(data["columns"]) for row in data["rows"])
    assert data["machine"]["python"].startswith("Python") and data["lock"]["gap-cli"]
    assert json.loads((tmp_path / f"{name}.json").read_text())["rows"] == data["rows"]
    assert (tmp_path / f"{name}.md").read_text() == markdown(data)


def test_others_are_measured_where_they_are_installed_and_said_to_be_missing_where_not(monkeypatch):
    names = {row[0] for row in graph(once()).rows}
    assert {"GaP", "LangGraph", "py_trees"} <= names
    monkeypatch.setattr("gap_cli.bench.graph.find_spec", lambda name: None)
    report = graph(once())
    assert {row[0] for row in report.rows} == {"GaP", "GaP, observed"}
    monkeypatch.setattr("gap_cli.bench.report.metadata.version", _missing_but(["numpy"]))
    assert as_data("graph", report)["lock"]["langgraph"] == "not installed"


def _missing_but(installed):
    from importlib import metadata

    def version(name):
        if name not in installed:
            raise metadata.PackageNotFoundError(name)
        return "1.0"

    return version


def test_progress_goes_from_nothing_to_all():
    seen = []
    timing.time_in_turns({"a": lambda: None, "b": lambda: None}, once(lambda done, what: seen.append(done)))
    assert seen == sorted(seen) and seen[0] == 0.0 and seen[-1] == 1.0


def test_everything_is_timed_in_every_round(monkeypatch):
    monkeypatch.setattr(timing, "_repeats", lambda call: 1)
    order = []
    timing.time_in_turns({"a": lambda: order.append("a"), "b": lambda: order.append("b")}, once(n=3))
    assert order == ["a", "b"] * 3


def test_markdown_is_a_table_whatever_is_in_it():
    data = as_data("x", BenchReport("T", ("name", "value"), (("a|b", 1.5), ("c", 2)), ("said",)))
    lines = markdown(data).splitlines()
    assert lines[2:6] == ["| name | value |", "|---|---:|", r"| a\|b | 1.5 |", "| c | 2 |"]
    assert "- said" in lines and "- Command: `gap bench x`" in lines


def test_without_a_name_the_benchmarks_are_listed():
    assert {"graph", "jail"} <= {row["name"] for row in json.loads(bench("--json").stdout)}


def test_an_unknown_benchmark_is_one_clear_error():
    done = CliRunner().invoke(app, ["bench", "grpah"])
    assert done.exit_code == 1 and "graph" in str(done.exception)


def test_more_tables_and_pictures_stand_beside_the_first(tmp_path, monkeypatch):
    import gap_cli.bench

    more = (Table("By size", ("size", "n"), (("small", 1), ("large", 2))),)
    pictures = (Picture("Worst cases", ".jpg", b"jpg"),)
    report = BenchReport("T", ("name",), (("a",),), more=more, pictures=pictures)
    monkeypatch.setattr(gap_cli.bench, "_graph", lambda bench: report)
    data = json.loads(bench("graph", "--json", "--to", str(tmp_path)).stdout)
    assert data["more"] == [{"title": "By size", "columns": ["size", "n"], "rows": [["small", 1], ["large", 2]]}]
    assert data["pictures"] == [{"file": "graph.jpg", "caption": "Worst cases"}]
    assert (tmp_path / "graph.jpg").read_bytes() == b"jpg"
    text = (tmp_path / "graph.md").read_text()
    assert "## By size\n\n| size | n |\n|---|---:|\n| small | 1 |" in text and "![Worst cases](graph.jpg)" in text


def test_several_pictures_are_numbered():
    report = BenchReport("T", (), (), pictures=(Picture("a", ".jpg", b"1"), Picture("b", ".png", b"2")))
    assert picture_files("x", report) == {"x-0.jpg": b"1", "x-1.png": b"2"}


def double(context, job):
    context.progress(0.5, "half")
    return job, 2 * job * context.n, sorted(context.tools)[:1], context.robot("panda").name


@pytest.mark.parametrize("workers", [1, 2])
def test_jobs_are_measured_in_their_order_by_workers_that_have_the_plugins(workers):
    seen = []
    run = BenchRun(load_registry(), n=3, workers=workers, watch=lambda done, what: seen.append((done, what)))
    tools = sorted(run.tools)[:1]
    assert run.map(double, [1, 2], lambda job: f"job {job}") == [(1, 6, tools, "panda"), (2, 12, tools, "panda")]
    assert seen[-1][0] == 1.0 and {what for _, what in seen} >= {"job 1", "job 2"}
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


def test_what_no_plugin_brings_is_named():
    run = BenchRun(load_registry())
    for ask in (run.robot, run.task, run.skill):
        with pytest.raises(UnknownNameError, match="nonesuch"):
            ask("nonesuch")
    assert run.skill("perception-single").name == "perception-single"
