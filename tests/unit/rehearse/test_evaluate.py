import threading

import pytest

from gap_cli.rehearse.evaluate import evaluate, make_engine
from gap_cli.rehearse.pool import LocalEngine
from gap_cli.rehearse.rehearsal import rehearse
from gap_cli.workspace.inventory import Inventory
from gap_runtime.bundle.bundle import GraphBundle
from gap_runtime.contracts.engine import EpisodeResult
from gap_runtime.errors import RunError, UnknownNameError


def files(folder):
    return {p: p.read_bytes() for p in folder.rglob("*") if p.is_file() and p.name != ".lock"}


@pytest.fixture
def candidate(make_run):
    run = make_run()
    return run, GraphBundle.load(run.graph_folder), Inventory.of(run.config)


def test_a_bundle_is_evaluated_as_a_run_is_rehearsed(candidate):
    run, bundle, inventory = candidate
    found = evaluate(bundle, range(3, 9), LocalEngine(2), inventory)
    rehearsed = rehearse(run, 6, record="none")
    assert found.rows == rehearsed.rows
    assert {**found.summary, "lock": ""} == {**rehearsed.summary, "lock": ""}
    assert found.clock["cycle_s"]["median"] > 0


def test_many_candidates_leave_the_run_as_it_was(candidate):
    run, bundle, inventory = candidate
    before = files(run.path)
    workflow = bundle.files["workflow.json"]
    slower = bundle.replace({"workflow.json": workflow.replace(
        '"tool": "cell.Act"', '"tool": "cell.Act", "inputs": {"seconds": 0.7}')})  # fmt: skip
    times = []
    for each in (bundle, slower):
        found = evaluate(each, range(3, 5), LocalEngine(1), inventory)
        times.append([row["motion_s"] for row in found.rows])
    assert all(b > a for a, b in zip(*times, strict=True))
    assert found.summary["bundle"] == inventory.digest(slower).sha256 != inventory.digest(bundle).sha256
    assert files(run.path) == before


class Engine:
    """Reports what it is told to, and looks at the job."""

    def __init__(self, *statuses, on_job=lambda job: None):
        self.passes, self.on_job = list(statuses), on_job

    def run(self, job, seeds, report, stop):
        self.on_job(job)
        status = self.passes.pop(0)
        for seed in seeds:
            void = status in ("crashed", "hung", "diverged", "infeasible")
            row = {"seed": seed, "status": status, "success": status == "success", "void": void, "reason": status}
            report(EpisodeResult(seed, {**row, "motion_s": 1.0, "judged_success": not void}, {"seed": seed}))


def test_workers_read_a_copy_that_no_edit_reaches(candidate):
    run, bundle, inventory = candidate
    seen = []

    def on_job(job):
        (run.graph_folder / "workflow.json").write_text("edited")
        seen.append((job.run, GraphBundle.load(job.run)))

    evaluate(bundle, range(1), Engine("success", on_job=on_job), inventory)
    ((folder, copy),) = seen
    assert copy == bundle and not folder.exists()


@pytest.mark.parametrize(
    ("first", "second", "differ", "said"),
    [
        ("failure", "failure", [], "Recording 2 failed"),
        ("failure", "error", [0, 1], "not deterministic"),
        ("diverged", "failure", [0, 1], "not deterministic"),
        ("failure", "crashed", [], "Seeds 0, 1 were lost while being recorded: crashed."),
        ("crashed", "failure", [], "Recording 2 failed"),
        ("hung", "crashed", [], "lost while being recorded"),
    ],
)
def test_a_lost_worker_says_nothing_about_determinism(candidate, tmp_path, first, second, differ, said):
    _, bundle, inventory = candidate
    heard = []
    found = evaluate(
        bundle, range(2), Engine(first, second), inventory, output=tmp_path / "out", record="failed", say=heard.append
    )
    assert found.not_reproduced == differ and said in " ".join(heard)
    assert ("not deterministic" in " ".join(heard)) == bool(differ)
    assert [row["status"] for row in found.rows] == [first] * 2


@pytest.mark.parametrize(("status", "measured"), [("crashed", False), ("diverged", False), ("failure", True)])
def test_void_episodes_measure_nothing(candidate, status, measured):
    _, bundle, inventory = candidate
    assert evaluate(bundle, range(2), Engine(status), inventory).measured is measured


def test_stopping_keeps_what_is_done(candidate):
    _, bundle, inventory = candidate
    stop = threading.Event()
    found = evaluate(
        bundle, range(3, 50), LocalEngine(1), inventory, stop=stop, progress=lambda result: stop.set()
    )  # fmt: skip
    assert found.interrupted and found.summary["partial"] and len(found.rows) == 1


def test_a_bundle_without_goals_is_refused(candidate):
    _, bundle, inventory = candidate
    rest = {name: text for name, text in bundle.files.items() if name != "goals.json"}
    with pytest.raises(RunError, match=r"goals\.json"):
        evaluate(GraphBundle(rest), range(1), LocalEngine(1), inventory)


def test_an_unknown_engine_names_the_local_one(candidate):
    with pytest.raises(UnknownNameError, match="local"):
        make_engine(candidate[2], "locale")
