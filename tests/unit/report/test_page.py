import re
import shutil
import subprocess
from html.parser import HTMLParser

import pytest

from gap_cli.rehearse.rehearsal import rehearse
from gap_cli.report.page import commands, write_report
from gap_runtime.errors import RunError

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Page(HTMLParser):
    """Collects text and addresses, and insists that every element is closed."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text, self.addresses, self.images = [], [], [], 0
        self.feed(html)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "action", "data"):
                self.addresses.append(value)
        self.images += tag == "img"

    def handle_startendtag(self, tag, attributes):
        pass

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.text.append(data)


@pytest.fixture
def rehearsed(once, make_run, faults):
    faults(seed4="slip")

    def make():
        run = make_run()
        return run, rehearse(run, 3, workers=1)

    return once("rehearsed", make)


def test_the_page_holds_what_was_found(rehearsed):
    run, summary = rehearsed
    page = Page(write_report(run).read_text())
    text = " ".join(" ".join(page.text).split())
    rate = summary.summary["success"]
    assert f"{rate['passed']} of {rate['of']}" in text
    for row in summary.rows:
        assert f"seed {row['seed']}" in text
        assert row["success"] or row["reason"] in text
    assert page.images == 6
    assert "cell.Act" in text and "little_cell" in text
    assert "simulated" in text and "symbolic" in text


def test_nothing_is_fetched_from_anywhere(rehearsed):
    run, _ = rehearsed
    html = write_report(run).read_text()
    assert all(a.startswith(("data:", "#")) for a in Page(html).addresses)
    assert not re.search(r"@import|url\((?!#)", html)
    assert "<script" not in html


def test_words_from_the_run_cannot_become_markup(make_run):
    run = make_run()
    file = run.path / "run.yaml"
    file.write_text(file.read_text().replace("Do it", "<script>alert(1)</script>"))
    html = write_report(run).read_text()
    assert "<script>" not in html and "&lt;script&gt;" in html


def test_a_run_not_rehearsed_shows_its_graph(make_run):
    text = " ".join(Page(write_report(make_run()).read_text()).text)
    assert "Not rehearsed yet" in text and "fake.Look" in text


def test_a_run_without_a_graph_is_told_what_to_type(make_run):
    run = make_run()
    (run.path / "generate/workflow.json").unlink()
    with pytest.raises(RunError, match="gap generate"):
        write_report(run)


def test_the_commands_are_those_that_made_it(rehearsed):
    run, summary = rehearsed
    lines = commands(run, summary.summary)
    assert lines[0] == "gap plan --task little --say 'Do it'"
    assert lines[-1] == "gap rehearse -n 3 --seed 3"


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium to draw the page")
@pytest.mark.slow
def test_a_browser_draws_it_in_light_and_in_dark(rehearsed, tmp_path):
    import cv2

    run, _ = rehearsed
    page = write_report(run)
    mean = {}
    for scheme, value in (("dark", 0), ("light", 1)):
        shot = tmp_path / f"{scheme}.png"
        subprocess.run(
            ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
             f"--blink-settings=preferredColorScheme={value}", "--window-size=1000,1400", f"--screenshot={shot}",
             page.resolve().as_uri()], check=True, capture_output=True, timeout=60,
        )  # fmt: skip
        image = cv2.imread(str(shot))
        assert image.std() > 5
        mean[scheme] = image.mean()
    assert mean["dark"] < 100 < 180 < mean["light"]
