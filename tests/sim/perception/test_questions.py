import pytest

from gap_runtime.contracts.failures import PerceptionError

pytestmark = pytest.mark.sim


@pytest.fixture
def ask(cell, cameras):
    return lambda prompt: cell.tool("vlm.Query", prompt=prompt, image=cameras[0].rgb).text


def test_presence_and_number(cell, ask, present):
    for name, model in cell.task.objects.items():
        assert ask(f"Is there a {model.label} in the image?") == ("yes" if name in present else "no")
    cans = [n for n in present if cell.task.objects[n].shape.kind == "cylinder"]
    assert ask("How many cans are there?") == str(len(cans))
    listed = ask("What objects are visible?").split(", ")
    assert sorted(listed) == sorted(cell.task.objects[n].label for n in present)


def test_left_and_right_are_as_the_picture_shows(cell, cameras, ask, present):
    centre = {}
    for name in present:
        box = (
            cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt=cell.task.objects[name].label)
            .detections[0]
            .box
        )
        centre[name] = (box.x_min + box.x_max) / 2
    first, last = (cell.task.objects[pick(centre, key=centre.get)].label for pick in (min, max))
    assert ask(f"Is the {first} left of the {last}?") == "yes"
    assert ask(f"Is the {first} to the right of the {last}?") == "no"


def test_nearer_the_camera_is_in_front(cell, cameras, ask, present, truth):
    eye = cameras[0].pose.position.array
    away = {n: abs(truth.bodies[n].pose.position.x - eye[0]) for n in present}
    near, far = (cell.task.objects[pick(away, key=away.get)].label for pick in (min, max))
    assert ask(f"Is the {near} in front of the {far}?") == "yes"
    assert ask(f"Is the {near} behind the {far}?") == "no"


def test_which_numbered_box(cell, cameras, ask, present):
    rows, numbers = [], {}
    for number, name in enumerate(present, 1):
        box = (
            cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt=cell.task.objects[name].label)
            .detections[0]
            .box
        )
        rows.append(f"{number}: [{box.x_min:.0f}, {box.y_min:.0f}, {box.x_max:.0f}, {box.y_max:.0f}]")
        numbers[name] = number
    for name, model in cell.task.objects.items():
        question = f"Which numbered box shows the {model.label}? Answer with one number or none.\n" + "\n".join(rows)
        assert ask(question) == str(numbers.get(name, "none"))


@pytest.mark.parametrize("prompt", ["What is the meaning of life?", "Is the weather nice?", "Is there a unicorn?"])
def test_what_is_beyond_it_is_said(cell, cameras, ask, prompt):
    assert ask(prompt).startswith("cannot answer: ")
    with pytest.raises(PerceptionError, match="Cannot answer"):
        cell.tool("vlm.QueryYesNo", prompt=prompt, image=cameras[0].rgb)


def test_yes_and_no_are_truth_values(cell, cameras):
    for tool in ("vlm.QueryYesNo", "molmo.QueryYesNo"):
        assert cell.tool(tool, prompt="Is there a basket?").answer is True
        assert cell.tool(tool, prompt="Is the basket in the basket?").answer is False
