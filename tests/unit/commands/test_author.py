"""`gap plan --author NAME`: an author that a plugin registers is used as ours is."""

import pytest

POET = """
from gap_runtime.hookspecs import hookimpl

CODE = '''
sg = Subgraph(name="main", skill="fake")
sg.add_node("act", type="tool", tool="{tool}")
sg.add_exit("done")
for edge in ((START, "act"), ("act", "done"), ("done", END)): sg.add_edge(*edge)
sg.set_on_error("failed")
sg.add_checkpoint("near", 'w.body("can").y < 0.04', rationale="The can ends up near.")
'''

class Poet:
    def plan(self, request):
        segment = {"name": "main", "skill": "fake", "layer": 0, "exits": ["done"], "on_error": "failed"}
        goals = {"goals": [{"predicate": "in", "roles": {"target": "can", "container": "bin"}}]}
        assert "cell.Act" in request.tools and request.skills["fake"].contract.swaps == ["other-skill"]
        return {"task": request.task.name, "instruction": request.instruction, "author": "?", "scene": "two",
                "goals": goals, "segments": [segment]}

    def subgraph(self, request, plan, segment, findings):
        return CODE.format(tool="cell.Act" if findings else "cell.Actt")

class Broken(Poet):
    def plan(self, request): return request.nothing

class Stubborn(Poet):
    def subgraph(self, request, plan, segment, findings): return CODE.format(tool="cell.Actt")

class Vague(Poet):
    def plan(self, request): return {"task": 7}

@hookimpl
def gap_register_authors(register):
    for author in (Poet, Broken, Stubborn, Vague): register(author.__name__.lower(), author)
"""
PLAN = ("plan", "--task", "little", "--say", "Do it")


@pytest.fixture(autouse=True)
def poets(install, little_cell):
    install("poets", POET)


def test_a_registered_author_writes_a_graph_and_answers_the_findings(gap, tmp_path):
    assert gap(*PLAN, "--author", "poet").code == 0
    assert "author: poet" in (tmp_path / "runs/little-001/run.yaml").read_text()
    done = gap("generate")
    assert done.code == 0, done.err
    assert "cell.Act" in (tmp_path / "runs/little-001/generate/workflow.json").read_text()
    assert gap("validate").code == 0


@pytest.mark.parametrize(
    ("author", "words"),
    [
        ("broken", ["'broken' of plugin 'poets' failed", "AttributeError"]),
        ("vague", ["the plan of author vague", "task"]),
        ("poett", ["Unknown author", "'poet'"]),
    ],
)
def test_an_author_that_fails_is_named(gap, tmp_path, author, words):
    done = gap(*PLAN, "--author", author)
    assert done.code == 1 and all(word in done.err for word in words), done.err
    assert not (tmp_path / "runs").exists()


def test_findings_an_author_does_not_answer_end_the_generation(gap):
    assert gap(*PLAN, "--author", "stubborn").code == 0
    done = gap("generate")
    assert done.code == 1 and "cell.Actt" in done.err
