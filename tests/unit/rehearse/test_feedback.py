import pytest

from gap_cli.rehearse.rehearsal import rehearse


@pytest.fixture
def page(once, make_run, faults):
    faults(seed4="slip", seed5="slip", seed6="segv")

    def make():
        run = make_run()
        summary = rehearse(run, 10, workers=2, record="none")
        return summary, (run.folder("rehearse/00") / "feedback.md").read_text()

    return once("page", make)


def test_the_page_says_what_the_rows_say(page):
    summary, text = page
    data = summary.summary
    (main,) = data["subgraphs"]
    assert f"({data['success']['passed']}/10)" in text
    assert f"| `main` | **{main['validation']['rate']:.2f} ({main['validation']['passed']}/10)** |" in text
    assert "The can ends up near." in text
    for group in data["failures"][:3]:
        assert f"seed {group['seeds'][0]}" in text and group["reason"] in text


def test_representative_failures_carry_their_numbers(page):
    summary, text = page
    slipped = next(r for r in summary.rows if r["cause"] == "slipped")
    visit = slipped["subgraphs"][-1]
    assert f"exit = {visit['exit']}" in text
    assert f"can_y = {visit['checkpoints']['near']['values']['can_y']:.3f}" in text
    assert "`main/act` failed: The jaws closed on nothing." in text
    assert "gripper:0 = 0.080" in text and "contacts [floor]" in text


def test_the_signal_names_what_the_contract_lets_one_change(page):
    _, text = page
    assert "Revise `main`" in text
    assert "swap `fake` for `other-skill`" in text and "tune `pace`" in text
    assert "1 episodes are void (1 crashed)" in text


def test_a_perfect_rehearsal_says_so(make_run, accept, monkeypatch):
    run = make_run()
    points = run.path / "generate/checkpoints/main_sg.py"
    points.write_text("CHECKPOINTS = []\n")
    accept(run)
    summary = rehearse(run, 12, workers=1, record="none")
    won = [r["seed"] for r in summary.rows if r["success"]]
    rehearse(run, 1, seed=won[0], record="none")
    text = (run.folder("rehearse/00") / "feedback.md").read_text()
    assert "Every subgraph keeps its promises" in text and "None." in text and "Nothing failed." in text
