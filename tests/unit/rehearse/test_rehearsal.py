import json
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from gap_cli.rehearse.rehearsal import rehearse
from gap_cli.workspace.canonical import plain, write_json
from gap_cli.workspace.metadata import read_meta
from gap_runtime.errors import GapError, RunError, UnknownNameError

SEEN_BY_GIT = ("episodes.jsonl", "summary.json", "feedback.md")


def canonical_bytes(run):
    return {name: (run.folder("rehearse/00") / name).read_bytes() for name in SEEN_BY_GIT}


def test_the_same_bytes_on_one_worker_on_two_and_again(make_run, tmp_path, monkeypatch):
    alone, again, shared = make_run(), make_run(), make_run()
    rehearse(alone, 8, workers=1, record="none")
    rehearse(again, 8, workers=1, record="none")
    (tmp_path / "meeting").mkdir()
    (tmp_path / "worked").mkdir()
    monkeypatch.setenv("CELL_MEET", str(tmp_path / "meeting"))
    rehearse(shared, 8, workers=2, record="none")
    assert len(list((tmp_path / "worked").iterdir())) == 2
    assert canonical_bytes(alone) == canonical_bytes(again) == canonical_bytes(shared)


def test_seeds_count_up_from_the_base_seed(make_run):
    run = make_run()
    assert [row["seed"] for row in rehearse(run, 3, record="none").rows] == [3, 4, 5]
    assert [row["seed"] for row in rehearse(run, 2, seed=9, record="none").rows] == [9, 10]


def test_an_episode_succeeds_where_graph_and_judge_agree(make_run):
    summary = rehearse(make_run(), 12, workers=2, record="none")
    for row in summary.rows:
        x = row["instance"]["can"][0]
        assert row["success"] == (x > -0.03)
        assert row["claimed"]
    won = sum(row["success"] for row in summary.rows)
    assert summary.summary["success"]["passed"] == won
    assert 0 < won < 12


def test_a_lost_worker_costs_its_episode_alone(make_run, faults):
    faults(seed4="segv", seed6="kill")
    summary = rehearse(make_run(), 5, workers=2, record="none")
    status = {row["seed"]: row["status"] for row in summary.rows}
    assert status[4] == status[6] == "crashed"
    assert summary.summary["void"] == {"crashed": 2}
    assert summary.summary["episodes"] == summary.summary["success"]["of"] == 5
    assert not {status[3], status[5], status[7]} & {"crashed"}


def test_a_diverged_episode_is_void_and_leaves_a_fresh_world(make_run, faults):
    plain, struck = make_run(), make_run()
    expected = rehearse(plain, 4, workers=1, record="none").rows
    faults(seed4="diverge")
    rows = rehearse(struck, 4, workers=1, record="none").rows
    assert rows[1]["void"] and rows[1]["status"] == "diverged" and "qacc" in rows[1]["reason"]
    assert [r for r in rows if r["seed"] != 4] == [r for r in expected if r["seed"] != 4]


@pytest.mark.parametrize("record", ["failed", "all"])
@pytest.mark.parametrize("seed", [3, 4])
def test_an_instance_that_cannot_be_placed_has_a_reason_and_no_evidence(make_run, faults, seed, record):
    run = make_run()
    faults(**{f"seed{seed}": "crowded"})
    summary = rehearse(run, 2, workers=1, record=record)
    row = next(row for row in summary.rows if row["seed"] == seed)
    assert row["void"] and row["status"] == "infeasible" and row["reason"].endswith("in 0 of 100 draws.")
    files = {p.name for p in run.folder("rehearse/00").rglob("*") if p.suffix in (".png", ".mcap")}
    assert files and not {name for name in files if f"{seed}" in name}


def test_a_rehearsal_without_any_instance_is_an_error(make_run, faults):
    faults(seed3="crowded", seed4="crowded")
    with pytest.raises(GapError, match="can in region here is in reach in 0 of 100 draws"):
        rehearse(make_run(), 2, record="none")


def test_an_episode_that_runs_out_of_time_says_so(make_run, plugin_folder):
    file = plugin_folder / "little_cell/tasks/little/task.yaml"
    good = file.read_text()
    try:
        file.write_text(good + "max_time: 0.001\n")
        row = rehearse(make_run(), 1, record="none").rows[0]
    finally:
        file.write_text(good)
    assert (row["stage"], row["cause"], row["reason"]) == ("main", "stopped", "The task's time is up.")


def test_a_failing_node_is_blamed_with_its_code(make_run, faults):
    faults(seed3="slip")
    row = rehearse(make_run(), 1, record="none").rows[0]
    assert (row["stage"], row["cause"]) == ("main", "slipped")
    assert row["reason"] == "main/act: The jaws closed on nothing."
    assert row["exits"] == [["main", "failed"]] and row["end"] == "abort"


def test_failed_episodes_are_recorded_and_others_are_not(make_run, faults):
    faults(seed3="slip")
    run = make_run()
    summary = rehearse(run, 8, workers=2, record="failed")
    failed = {row["seed"] for row in summary.rows if not row["success"]}
    recorded = {int(p.stem.removeprefix("seed-")) for p in run.folder("rehearse/00").glob("*.mcap")}
    assert recorded == failed != set()
    assert summary.not_reproduced == []


def test_first_and_last_frames_are_kept(make_run):
    run = make_run()
    rehearse(run, 2, record="none")
    frames = sorted(p.name for p in (run.folder("rehearse/00") / "frames").iterdir())
    assert frames == [f"seed-{s:06d}-{w}.png" for s in (3, 4) for w in ("first", "last")]


def test_what_an_earlier_rehearsal_left_is_gone(make_run, faults):
    run = make_run()
    rehearse(run, 3, record="all")
    rehearse(run, 1, record="none")
    names = {p.name for p in run.folder("rehearse/00").rglob("*") if p.is_file()}
    assert not any(name.endswith(".mcap") for name in names)
    assert "seed-000004-first.png" not in names


def test_clocks_stay_out_of_what_git_sees(make_run):
    run = make_run()
    summary = rehearse(run, 2, record="none")
    assert read_meta(run)["stages"]["rehearse"]["cycle_s"] == plain(summary.clock["cycle_s"])
    for data in canonical_bytes(run).values():
        for word in (b"wall_s", b"compute_s", b"cycle_s", str(run.path).encode(), run.name.encode()):
            assert word not in data


def test_a_graph_must_be_validated_and_sound(make_run):
    run = make_run()
    findings = run.path / "validate/findings.json"
    kept = json.loads(findings.read_text())
    findings.unlink()
    with pytest.raises(RunError, match="gap validate"):
        rehearse(run, 1)
    error = {"code": "S7", "path": "nodes.x", "message": "leads nowhere", "severity": "error"}
    write_json(findings, {**kept, "findings": [error]})
    with pytest.raises(RunError, match="S7 nodes"):
        rehearse(run, 1)


def test_a_plugin_may_bring_the_engine(make_run):
    run = make_run()
    summary = rehearse(run, 2, workers=7, record="none", engine="elsewhere")
    assert [row["reason"] for row in summary.rows] == ["7 workers, recording False"] * 2
    assert read_meta(run)["stages"]["rehearse"]["engine"] == "elsewhere"


def test_an_unknown_engine_names_the_local_one(make_run):
    with pytest.raises(UnknownNameError, match="local"):
        rehearse(make_run(), 1, engine="locale")


@contextmanager
def gap(*arguments):
    command = [sys.executable, "-m", "gap_cli.main", *map(str, arguments)]
    with subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            process.kill()


def first_line(process):
    assert process.stderr
    return process.stderr.readline()


def test_ctrl_c_keeps_what_is_done_and_says_it_is_partial(make_run):
    run = make_run()
    with gap("rehearse", run.path, "-n", 5000, "-w", 2, "--record", "none") as process:
        assert first_line(process).startswith("[1/5000]")
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    summary = json.loads((run.folder("rehearse/00") / "summary.json").read_text())
    rows = (run.folder("rehearse/00") / "episodes.jsonl").read_text().splitlines()
    assert summary["partial"] and 0 < summary["episodes"] == len(rows) < 5000


def test_ctrl_c_twice_stops_now_and_leaves_no_worker(make_run, faults, tmp_path, monkeypatch):
    faults(seed3="sleep", seed4="sleep")
    (tmp_path / "asleep").mkdir()
    monkeypatch.setenv("CELL_ASLEEP", str(tmp_path / "asleep"))
    run = make_run()
    with gap("rehearse", run.path, "-n", 2, "-w", 2, "--record", "none") as process:
        while len(list((tmp_path / "asleep").iterdir())) < 2:
            assert process.poll() is None
            time.sleep(0.02)
        workers = workers_of(process.pid)
        assert len(workers) == 2
        process.send_signal(signal.SIGINT)
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 130
    assert not any(alive(pid) for pid in workers)
    assert not (run.folder("rehearse/00") / "summary.json").exists()


def test_a_run_being_rehearsed_is_in_use(make_run, faults):
    faults(seed4="sleep")
    run = make_run()
    with gap("rehearse", run.path, "-n", 2, "-w", 1, "--record", "none") as process:
        first_line(process)
        with gap("rehearse", run.path, "-n", 1) as second:
            out, err = second.communicate(timeout=60)
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 130
    assert second.returncode == 1 and out == ""
    assert f"in use by process {process.pid}" in err


def workers_of(pid):
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(p) for p in found if b"gap_cli.rehearse.worker" in Path(f"/proc/{p}/cmdline").read_bytes()]


def alive(pid):
    return Path(f"/proc/{pid}").exists()
