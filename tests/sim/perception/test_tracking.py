import numpy as np
import pytest

from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image

pytestmark = pytest.mark.sim
INIT, UPDATE, CLOSE = (f"sam3_tracker.{m}Tracker" for m in ("Init", "Update", "Close"))


@pytest.fixture
def image(cameras):
    return cameras[0].rgb


def test_a_named_object_is_followed_and_forgotten(cell, image):
    started = cell.tool(INIT, image=image, text="basket")
    assert started.object_present and started.score > 0.8
    again = cell.tool(UPDATE, tracker_id=started.tracker_id, image=image)
    assert again.mask == started.initial_mask and again.box == started.initial_box and again.object_present
    cell.tool(CLOSE, tracker_id=started.tracker_id)
    for tool, more in ((UPDATE, {"image": image}), (CLOSE, {})):
        with pytest.raises(BadRequestError, match="No tracker"):
            cell.tool(tool, tracker_id=started.tracker_id, **more)


def test_text_box_and_point_start_the_same_track(cell, image):
    by_text = cell.tool(INIT, image=image, text="basket")
    x, y, _ = cell.tool("molmo.PointPrompt", image=image, object_name="basket")
    by_box = cell.tool(INIT, image=image, box=by_text.initial_box)
    by_point = cell.tool(INIT, image=image, pixel_x=x, pixel_y=y, use_point=True)
    assert by_text.initial_mask == by_box.initial_mask == by_point.initial_mask
    assert len({by_text.tracker_id, by_box.tracker_id, by_point.tracker_id}) == 3


def test_another_camera_shows_the_same_object(cell, cameras, present):
    name = cell.task.objects[present[1]].label
    started = cell.tool(INIT, image=cameras[0].rgb, text=name)
    seen = cell.tool(UPDATE, tracker_id=started.tracker_id, image=cameras[1].rgb)
    expected = cell.tool("sam3.SegmentText", image=cameras[1].rgb, text_prompt=name)
    assert seen.mask == expected.masks[0]


def test_an_object_that_moved_is_found_where_it_went(cell, image, present):
    started = cell.tool(INIT, image=image, text="basket")
    later = np.roll(image.data, (0, 25), axis=(0, 1))  # a new picture, of which there is no depth
    with node_scope("test"):
        seen = cell.tool(UPDATE, tracker_id=started.tracker_id, image=Image(later))
    assert seen.object_present
    assert seen.box.x_min == pytest.approx(started.initial_box.x_min + 25, abs=8)


def test_what_is_gone_is_reported_gone_and_may_come_back(cell, image):
    started = cell.tool(INIT, image=image, text="basket")
    gone = cell.tool(UPDATE, tracker_id=started.tracker_id, image=Image(np.full((480, 640, 3), 120, np.uint8)))
    assert not gone.object_present and not gone.mask.data.any() and gone.confidence == 0
    assert cell.tool(UPDATE, tracker_id=started.tracker_id, image=image).object_present


@pytest.mark.parametrize("text", ["unicorn", "a can in the basket"])
def test_what_is_not_there_starts_absent(cell, image, text):
    started = cell.tool(INIT, image=image, text=text)
    assert not started.object_present and started.score == 0 and started.initial_box == BoundingBox2D(0, 0, 0, 0)


@pytest.mark.parametrize("seed", [{}, {"text": "basket", "use_point": True}, {"text": " "}])
def test_exactly_one_seed_is_needed(cell, image, seed):
    with pytest.raises(BadRequestError, match="exactly one"):
        cell.tool(INIT, image=image, **seed)


def test_names_of_trackers_depend_on_content_alone(cell, image):
    first = [cell.tool(INIT, image=image, text=t).tracker_id for t in ("basket", "grocery")]
    cell.state.pop("gap_perception.trackers")
    assert sorted(cell.tool(INIT, image=image, text=t).tracker_id for t in ("grocery", "basket")) == sorted(first)
