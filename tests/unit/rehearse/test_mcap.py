"""A recording is read back with the public mcap reader, as Foxglove would."""

import io
import json

import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from gap_cli.rehearse.recording import mcap
from gap_cli.rehearse.rehearsal import rehearse


@pytest.fixture
def recording(once, make_run, faults):
    """The row of one episode, and topic -> [(log time [ns], schema, message)] of its recording."""
    faults(seed3="slip")
    return once("recording", lambda: record(make_run))


def record(make_run):
    run = make_run()
    summary = rehearse(run, 1, record="all")
    (path,) = run.folder("rehearse/00").glob("*.mcap")
    found = {}
    with path.open("rb") as file:
        reader = make_reader(io.BytesIO(file.read()), validate_crcs=True, decoder_factories=[DecoderFactory(), Json()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, schema.name, decoded))
    return summary.rows[0], found


class Json:
    def decoder_for(self, encoding, schema):
        return json.loads if encoding == "json" else None


def test_it_holds_what_a_person_wants_to_see(recording):
    _, found = recording
    schemas = {topic: entries[0][1] for topic, entries in found.items()}
    assert schemas == {
        "/camera/agentview/image": "foxglove.CompressedImage",
        "/camera/agentview/calibration": "foxglove.CameraCalibration",
        "/camera/wrist/image": "foxglove.CompressedImage",
        "/camera/wrist/calibration": "foxglove.CameraCalibration",
        "/joint_states": "foxglove.JointStates",
        "/tf": "foxglove.FrameTransforms",
        "/scene": "foxglove.SceneUpdate",
        "/log": "foxglove.Log",
        "/node_events": schemas["/node_events"],
    }


def test_images_are_jpegs_of_the_cameras(recording):
    import cv2
    import numpy as np

    _, found = recording
    for _, _, image in found["/camera/agentview/image"]:
        assert image.format == "jpeg" and image.frame_id == "camera:agentview"
        assert cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR).shape == (4, 6, 3)


def test_times_are_world_time_and_only_grow(recording):
    row, found = recording
    for entries in found.values():
        times = [t for t, *_ in entries]
        assert times == sorted(times)
    assert max(t for t, *_ in found["/node_events"]) / 1e9 == pytest.approx(row["motion_s"])


def test_stamp_and_log_time_are_one_instant(recording):
    _, found = recording
    for topic in ("/camera/wrist/image", "/log", "/tf"):
        for when, _, message in found[topic]:
            stamp = message.transforms[0].timestamp if topic == "/tf" else message.timestamp
            assert stamp.ToNanoseconds() == when


@pytest.mark.parametrize("seconds", [0.0, 2.9999999999, 3.0, 3.0000000004, 0.1 + 0.2, 1e6 - 1e-11])
def test_a_stamp_is_its_log_time_in_seconds_and_nanoseconds(seconds):
    stamp = mcap._stamp(seconds)
    assert stamp.sec * 1_000_000_000 + stamp.nsec == mcap._ns(seconds) == round(seconds * 1e9)


def test_node_events_tell_the_story_of_the_row(recording):
    row, found = recording
    events = [event for _, _, event in found["/node_events"]]
    assert [e["seq"] for e in events] == sorted(e["seq"] for e in events)
    ended = [e["path"] for e in events if e["kind"] in ("node_finished", "node_failed")]
    assert ended == [node["node"] for node in row["nodes"]]


def test_the_failure_is_in_the_log_as_an_error(recording):
    _, found = recording
    errors = [log.message for _, _, log in found["/log"] if log.level == log.ERROR]
    assert any("main/act" in text and "jaws closed on nothing" in text for text in errors)


def test_joints_carry_the_robots_names_and_objects_their_frames(recording):
    _, found = recording
    assert [j.name for j in found["/joint_states"][0][2].joints] == ["shoulder", "elbow", "gripper:0"]
    (scene,) = [update for _, _, update in found["/scene"]]
    entities = {e.id: e for e in scene.entities}
    assert len(entities["can"].cylinders) == 1 and len(entities["bin"].cubes) == 5
    frames = {t.child_frame_id for t in found["/tf"][0][2].transforms}
    assert {"tcp:0", "camera:agentview", "can", "bin"} <= frames


def test_recording_changes_nothing(make_run):
    plain, recorded = make_run(), make_run()
    rows = rehearse(plain, 2, record="none").rows
    assert rehearse(recorded, 2, record="all").rows == rows
