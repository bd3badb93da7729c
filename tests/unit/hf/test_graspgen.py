"""GraspGen's server over its own protocol: a fake that writes with msgpack-numpy itself, and frames that fit ours."""

from __future__ import annotations

import threading
from types import SimpleNamespace

import msgpack
import msgpack_numpy
import numpy as np
import pytest
import zmq
from scipy.spatial.transform import Rotation

from gap_hf.grasps import client as grasp_client
from gap_hf.grasps import graspgen
from gap_hf.wire import packed, unpacked
from gap_robots.panda import panda
from gap_runtime.contracts.failures import BadRequestError, PerceptionError, ToolError
from gap_runtime.contracts.types import PointCloud

PANDA = panda()
DEPTH = grasp_client.DEPTHS["franka_panda"]
CLOUD = np.random.default_rng(0).uniform(-0.02, 0.02, (200, 3)) + np.array([0.1, 0.2, 0.05])
DOWN = Rotation.from_euler("x", np.pi).as_matrix()


def grasp_at(point, R=DOWN):
    """T_world_gripper whose TCP is at a point, in GraspGen's convention: x closes, z approaches."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = np.asarray(point) - R[:, 2] * DEPTH
    return T


class Server(threading.Thread):
    """A REP socket that answers as the published server does; `answers` maps an action to a dict, or is raw bytes."""

    def __init__(self, answers):
        super().__init__(daemon=True)
        self.answers, self.asked = answers, []
        self.context = zmq.Context()
        self.socket = self.context.socket(zmq.REP)
        self.socket.setsockopt(zmq.LINGER, 0)
        self.port = self.socket.bind_to_random_port("tcp://127.0.0.1")
        self.done = threading.Event()

    def run(self):
        while not self.done.is_set():
            if not self.socket.poll(20):
                continue
            request = msgpack.unpackb(self.socket.recv(), object_hook=msgpack_numpy.decode, raw=False)
            self.asked.append(request)
            answer = self.answers.get(request["action"], {"error": f"Unknown action: {request['action']}"})
            if not isinstance(answer, bytes):
                answer = msgpack.packb(answer, default=msgpack_numpy.encode, use_bin_type=True)
            if answer:
                self.socket.send(answer)
        self.socket.close()
        self.context.term()


@pytest.fixture
def server(monkeypatch):
    """Start a server with these grasps and confidences, or this answer to `infer`."""
    started = []

    def start(grasps=(), confidences=(), **answers):
        found = {
            "grasps": np.asarray(grasps, np.float32).reshape(-1, 4, 4),
            "confidences": np.asarray(confidences, np.float32),
            "num_grasps": len(grasps),
            "timing": {"infer_ms": 1.0},
        }
        server = Server({"metadata": {"gripper_name": "franka_panda"}, "infer": found, **answers})
        server.start()
        started.append(server)
        monkeypatch.setenv(grasp_client.URL, f"tcp://127.0.0.1:{server.port}")
        return server

    yield start
    for each in started:
        each.done.set()
        each.join()


def plan(**options):
    ctx = SimpleNamespace(robot=lambda arm_id=0: PANDA)
    return graspgen.plan_from_point_cloud(ctx, **{"target_cloud": PointCloud(CLOUD), **options})


def test_the_cloud_and_the_knobs_arrive(server):
    started = server([grasp_at((0.1, 0.2, 0.05))], [0.9])
    plan(num_grasps=123, topk_num_grasps=7, grasp_threshold=0.2, remove_outliers=False)
    asked = started.asked[-1]
    assert asked["action"] == "infer"
    assert asked["point_cloud"].dtype == np.float32 and np.allclose(asked["point_cloud"], CLOUD, atol=1e-6)
    knobs = {k: v for k, v in asked.items() if k not in ("action", "point_cloud")}
    assert knobs == {
        "num_grasps": 123, "topk_num_grasps": 7, "grasp_threshold": 0.2, "remove_outliers": False,
    }  # fmt: skip


@pytest.mark.parametrize("yaw", [0, 30, 90, 200])
def test_poses_are_the_tcp_in_our_convention(server, yaw):
    R = Rotation.from_euler("z", yaw, degrees=True).as_matrix() @ DOWN
    server([grasp_at((0.1, 0.2, 0.05), R)], [0.9])
    (pose,) = plan().grasp_poses
    T = pose.matrix
    assert np.allclose(T[:3, 3], (0.1, 0.2, 0.05), atol=1e-6)
    assert np.allclose(T[:3, 2], R[:, 2], atol=1e-6), "z approaches in both"
    assert np.allclose(T[:3, 1], R[:, 0], atol=1e-6), "our y closes, theirs is x"
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


def test_best_first_cut_and_thresholded(server):
    server([grasp_at((0.1, 0.2, z)) for z in (0.03, 0.04, 0.05, 0.06)], [0.2, 0.9, 0.5, 0.7])
    found = plan(topk_num_grasps=2)
    assert found.scores == pytest.approx([0.9, 0.7])
    assert [p.position.z for p in found.grasp_poses] == pytest.approx([0.04, 0.06])
    assert plan(grasp_threshold=0.6).scores == pytest.approx([0.9, 0.7])


def test_contacts_are_points_of_the_cloud_on_the_closing_line(server):
    server([grasp_at((0.1, 0.2, 0.05))], [0.9])
    found = plan()
    (contact,), (pose,) = found.contact_points, found.grasp_poses
    assert (np.abs(CLOUD - contact.array).sum(axis=1) == 0).any()
    local = pose.matrix[:3, :3].T @ (contact.array - pose.position.array)
    assert np.hypot(local[0], local[2]) < 0.005


def test_poses_whose_hand_meets_the_scene_are_left_out(server):
    server(
        [
            grasp_at((0.1, 0.2, 0.05)),
            grasp_at((0.1, 0.2, 0.05), Rotation.from_euler("z", 90, degrees=True).as_matrix() @ DOWN),
        ],
        [0.9, 0.8],
    )
    beside = np.random.default_rng(1).uniform(-0.006, 0.006, (400, 3)) + np.array(
        [0.145, 0.2, 0.05]
    )  # where a finger goes
    assert len(plan().scores) == 2
    assert plan(scene_cloud=PointCloud(np.concatenate([CLOUD, beside]))).scores == pytest.approx([0.8])
    assert len(plan(scene_cloud=PointCloud(CLOUD)).scores) == 2, "the target itself is no obstacle"


def test_no_grasps_is_an_empty_answer(server):
    server()
    assert plan() == ([], [], [])


def test_another_gripper_needs_its_depth(server, monkeypatch):
    server([grasp_at((0.1, 0.2, 0.05))], [0.9], metadata={"gripper_name": "robotiq_2f_140"})
    with pytest.raises(ToolError, match=r"'robotiq_2f_140'.*GAP_HF_GRASPGEN_DEPTH") as caught:
        plan()
    assert caught.value.code == "setting"
    monkeypatch.setenv(grasp_client.DEPTH, str(DEPTH))
    assert len(plan().scores) == 1


@pytest.mark.parametrize(
    ("answer", "code"),
    [
        ({"error": "CUDA out of memory"}, "server"),
        ({"grasps": np.zeros((2, 4, 4), np.float32), "confidences": np.zeros(2, np.float32)}, "answer"),
        ({"grasps": np.eye(4, dtype=np.float32)[None], "confidences": np.zeros(3, np.float32)}, "answer"),
        ({"confidences": np.zeros(3, np.float32)}, "answer"),
        (b"\xc1 not msgpack", "answer"),
        (msgpack.packb([1, 2]), "answer"),
    ],
)
def test_answers_it_cannot_use(server, answer, code):
    server(infer=answer)
    with pytest.raises(ToolError) as caught:
        plan()
    assert caught.value.code == code


def test_a_server_that_does_not_answer(server, monkeypatch):
    monkeypatch.setattr(grasp_client, "TIMEOUT_S", 0.2)
    server(infer=b"")
    with pytest.raises(ToolError, match=r"did not answer within 0\.2 s") as caught:
        plan()
    assert caught.value.code == "timeout"


@pytest.mark.parametrize("url", ["", "localhost:5556", "http://x"])
def test_settings_that_name_no_server(monkeypatch, url):
    monkeypatch.setenv(grasp_client.URL, url)
    with pytest.raises(ToolError, match="must name a GraspGen server"):
        plan()


def test_requests_it_will_not_send():
    with pytest.raises(BadRequestError):
        plan(num_grasps=0)
    with pytest.raises(PerceptionError, match="5 usable points"):
        plan(target_cloud=PointCloud(np.vstack([CLOUD[:5], np.full((9, 3), np.nan)])))


@pytest.mark.parametrize("dtype", ["<f4", "<f8", "|u1", "<i8", "|b1"])
def test_arrays_travel_as_msgpack_numpy_writes_them(dtype):
    array = np.arange(12).reshape(3, 4).astype(dtype)
    theirs = msgpack.unpackb(packed({"a": array}), object_hook=msgpack_numpy.decode, raw=False)["a"]
    ours = unpacked(msgpack.packb({"a": array, "b": array.max()}, default=msgpack_numpy.encode, use_bin_type=True))
    assert theirs.dtype == array.dtype and np.array_equal(theirs, array)
    assert ours["a"].dtype == array.dtype and np.array_equal(ours["a"], array) and ours["b"] == array.max()


@pytest.mark.parametrize(
    "message",
    [
        msgpack.packb(np.array([{}], dtype=object), default=msgpack_numpy.encode),
        msgpack.packb({b"nd": True, b"type": "<f4", b"kind": b"", b"shape": [9], b"data": b"1234"}),
        msgpack.packb({b"nd": True, b"type": "|S4", b"kind": b"", b"shape": [1], b"data": b"1234"}),
        msgpack.packb({b"nd": True}),
    ],
)
def test_what_is_no_numeric_array_is_not_read(message):
    with pytest.raises(ValueError, match=r"array|message"):
        unpacked(message)
