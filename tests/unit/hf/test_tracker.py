"""SAM 3's tracker: frames in order, an object by text, box, point; freed on close, bounded however long it runs."""

from __future__ import annotations

import numpy as np
import pytest

from gap_hf.vision import concepts, following, tracker
from gap_hf.vision.concepts import ConceptInstance
from gap_hf.vision.following import FollowedMask
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import BoundingBox2D, Image
from tests.unit.hf import tiny

BOX = BoundingBox2D(20, 10, 60, 30)


def frame(shift=0):
    return Image(tiny.picture(60, 100, (20 + shift, 10, 60 + shift, 30)))


@pytest.fixture
def served(serve):
    serve("sam3_tracker", "sam3")
    serve("sam3")


def begin(ctx, **seed):
    return tracker.init_tracker(ctx, image=frame(), **seed)


def update(ctx, name, image):
    return tracker.update_tracker(ctx, tracker_id=name, image=image)


@pytest.mark.parametrize("seed", [{"box": BOX}, {"use_point": True, "pixel_x": 40, "pixel_y": 20}])
def test_an_object_is_followed_through_frames(served, ctx, seed):
    started = begin(ctx, **seed)
    assert started.initial_mask.data.shape == (60, 100)
    assert 0 <= started.score <= 1
    for shift in range(1, 4):
        seen = update(ctx, started.tracker_id, frame(shift))
        assert seen.mask.data.shape == (60, 100)
        assert seen.object_present == bool(seen.mask.data.any())


def test_the_same_frames_give_the_same_masks(served, ctx):
    def run():
        name = begin(ctx, box=BOX).tracker_id
        seen = [update(ctx, name, frame(shift)) for shift in (1, 2)]
        tracker.close_tracker(ctx, tracker_id=name)
        return seen

    assert run() == run()


def test_what_was_seen_before_matters(served, ctx):
    held = following.start(frame(), following.Prompt(box=(20, 10, 60, 30)))[0]
    other = following.start(frame(), following.Prompt(box=(0, 30, 100, 60)))[0]
    chances = [following.follow(track, frame(1)).chance for track in (held, other)]
    assert chances[0] != chances[1]


def test_a_mask_seed_is_what_is_seen_first(served):
    mask = np.zeros((60, 100), bool)
    mask[15:45, 25:75] = True
    _, seen = following.start(frame(), following.Prompt(), mask)
    overlap = (seen.mask & mask).sum() / (seen.mask | mask).sum()
    assert overlap > 0.9 and seen.chance > 0.5


def test_a_long_track_holds_no_more_than_the_network_looks_at(served):
    track, _ = following.start(frame(), following.Prompt(box=(20, 10, 60, 30)))
    sizes = []
    for shift in range(1, 9):
        following.follow(track, frame(shift % 4))
        (outputs,) = track.session.output_dict_per_obj.values()
        sizes.append(len(outputs["non_cond_frame_outputs"]))
        assert not track.session.processed_frames
    assert max(sizes[5:]) == sizes[-1] <= 5


def test_an_object_named_by_text_is_awaited_until_it_shows(served, ctx, monkeypatch):
    mask = np.zeros((60, 100), bool)
    mask[10:30, 20:60] = True
    shows = iter([[], [], [ConceptInstance(0.9, mask, BOX)]])
    monkeypatch.setattr(concepts, "instances", lambda image, text: next(shows))
    started = begin(ctx, text="red can", object_name="can")
    assert started.tracker_id.startswith("can-")
    assert not started.object_present and not started.initial_mask.data.any()
    assert not update(ctx, started.tracker_id, frame()).object_present
    found = update(ctx, started.tracker_id, frame())
    assert found.object_present and found.mask.data[20, 40]
    assert update(ctx, started.tracker_id, frame(1)).mask.data.shape == (60, 100)


def test_an_absent_object_has_an_empty_mask(served, ctx, monkeypatch):
    started = begin(ctx, box=BOX)
    full = np.ones((60, 100), bool)
    monkeypatch.setattr(following, "follow", lambda track, image: FollowedMask(full, 0.2))
    seen = update(ctx, started.tracker_id, frame(1))
    assert not seen.object_present and not seen.mask.data.any() and seen.confidence == 0.2


def test_a_closed_tracker_is_gone(served, ctx):
    name = begin(ctx, box=BOX).tracker_id
    tracker.close_tracker(ctx, tracker_id=name)
    with pytest.raises(BadRequestError, match="No tracker"):
        update(ctx, name, frame(1))
    with pytest.raises(BadRequestError, match="No tracker"):
        tracker.close_tracker(ctx, tracker_id=name)


def test_two_trackers_of_one_thing_have_two_ids(served, ctx):
    assert begin(ctx, box=BOX).tracker_id != begin(ctx, box=BOX).tracker_id


def test_a_frame_of_another_size_is_refused(served, ctx):
    name = begin(ctx, box=BOX).tracker_id
    with pytest.raises(BadRequestError, match="follows 100x60 frames"):
        update(ctx, name, Image(tiny.picture(48, 80)))


@pytest.mark.parametrize("seed", [{}, {"text": "can", "box": BOX}, {"text": "can", "use_point": True}])
def test_exactly_one_seed(ctx, seed):
    with pytest.raises(BadRequestError, match="exactly one"):
        begin(ctx, **seed)
