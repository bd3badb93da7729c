"""A client of GraspGen's published inference server: its protocol, its gripper frame, and what it leaves to the caller.

Protocol (client-server/ of the GraspGen repository): msgpack with numpy arrays over a ZeroMQ REQ socket. A request
`{"action": "infer", "point_cloud": (N, 3) float32, num_grasps, topk_num_grasps, grasp_threshold, remove_outliers}` is
answered by `{"grasps": (K, 4, 4), "confidences": (K,)}`, `{"action": "metadata"}` by `{"gripper_name": ...}`, and what
failed by `{"error": text}`.
Gripper frame (docs/GRIPPER_DESCRIPTION.md): z approaches, x closes, `depth` from base to TCP.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from gap_catalogue.grasps import GraspgenPlanFromPointCloud, WorldGrasps
from gap_catalogue.shared.hand import Hand, clear_of
from gap_catalogue.shared.point_clouds import require_surface
from gap_hf.grasps.network_grasps import listed, rigid_grasps, tcp
from gap_hf.loading import INSTALL
from gap_hf.wire import packed, unpacked
from gap_runtime.contracts.failures import ToolError
from gap_runtime.contracts.robot import RobotSpec
from gap_runtime.contracts.types import Array

URL, DEPTH = "GAP_HF_GRASPGEN_URL", "GAP_HF_GRASPGEN_DEPTH"
DEPTHS = {"franka_panda": 0.10527314}  # m, base of the gripper to its TCP, as the checkpoint's gripper file has it
TIMEOUT_S = 60.0
NEAR = 0.01  # m from the target within which scene points are the target's own


def plan(robot: RobotSpec, request: GraspgenPlanFromPointCloud) -> WorldGrasps:
    """Grasps on the target, clear of the scene, best first; see `graspgen.plan_from_point_cloud`."""
    target = request.target_cloud.points
    target = target[np.isfinite(target).all(axis=1)]
    require_surface(target)
    with Server() as server:
        depth = _depth(server)
        answer = server.ask(
            {
                "action": "infer",
                "point_cloud": target.astype(np.float32),
                "num_grasps": request.num_grasps,
                "topk_num_grasps": request.topk_num_grasps,
                "grasp_threshold": request.grasp_threshold,
                "remove_outliers": request.remove_outliers,
            }
        )
    T, scores = rigid_grasps("The GraspGen server", answer.get("grasps"), answer.get("confidences"))
    T = T @ tcp(depth)
    if request.scene_cloud is not None:
        free = _clear(robot, T, target, request.scene_cloud.points)
        T, scores = T[free], scores[free]
    order = np.argsort(-scores, kind="stable")
    # the server repeats itself until it has forty
    order = order[scores[order] >= request.grasp_threshold][: request.topk_num_grasps]
    contacts = np.array([_contact(T[i], target) for i in order])
    return WorldGrasps(*listed(T[order], scores[order], contacts))


class Server:
    """One conversation with the server. Raises `ToolError`: `setting`, `extra`, `unreachable`, `timeout`, `server`."""

    def __init__(self) -> None:
        self.url = os.environ.get(URL, "").strip()
        if not self.url.startswith("tcp://"):
            raise ToolError("setting", f"{URL} must name a GraspGen server.", hint=f"E.g. {URL}=tcp://localhost:5556.")
        try:
            import zmq
        except ImportError:
            raise ToolError("extra", "pyzmq is not installed.", hint=INSTALL) from None
        self._zmq: Any = zmq

    def __enter__(self) -> Server:
        self._context = self._zmq.Context()
        self._socket = self._context.socket(self._zmq.REQ)
        self._socket.setsockopt(self._zmq.LINGER, 0)
        try:
            self._socket.connect(self.url)
        except self._zmq.ZMQError as problem:
            self.__exit__()
            raise ToolError("unreachable", f"{self.url} is no address: {problem}.", hint=f"Is {URL} right?") from None
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()
        self._context.term()

    def ask(self, message: dict[str, Any]) -> dict[str, Any]:
        """The answer to one message."""
        self._socket.send(packed(message))
        if not self._socket.poll(int(TIMEOUT_S * 1000)):
            raise ToolError("timeout", f"{self.url} did not answer within {TIMEOUT_S:g} s.", hint=f"Is {URL} right?")
        try:
            answer = unpacked(self._socket.recv())
        except ValueError as problem:
            raise ToolError("answer", f"{self.url} answered with something else: {problem}.") from None
        if not isinstance(answer, dict):
            raise ToolError("answer", f"{self.url} answered with a {type(answer).__name__}, not a message.")
        if "error" in answer:
            raise ToolError("server", f"The GraspGen server failed: {str(answer['error'])[:200]}.")
        return answer


def _depth(server: Server) -> float:
    """How far the TCP lies before the base of the gripper the server's network was trained for [m]."""
    chosen = os.environ.get(DEPTH, "").strip()
    if chosen:
        try:
            return float(chosen)
        except ValueError:
            raise ToolError("setting", f"{DEPTH} is {chosen!r}, not a length in metres.") from None
    name = server.ask({"action": "metadata"}).get("gripper_name")
    if name not in DEPTHS:
        raise ToolError(
            "setting",
            f"The server plans for the gripper {name!r}, whose depth is not known here.",
            hint=f"Set {DEPTH} to the `depth` in that gripper's file [m]. Known: {', '.join(DEPTHS)}.",
        )
    return DEPTHS[name]


def _clear(robot: RobotSpec, T: Array, target: Array, scene: Array) -> Array:
    """True for each pose whose wide open hand meets nothing of the scene but the target."""
    from scipy.spatial import cKDTree

    scene = scene[np.isfinite(scene).all(axis=1)]
    if not len(scene):
        return np.ones(len(T), dtype=bool)
    distance, _ = cKDTree(target).query(scene, distance_upper_bound=NEAR)
    return clear_of(scene[~np.isfinite(distance)], T, Hand.of(robot))


def _contact(T: Array, target: Array) -> Array:
    """The target's point nearest the line along which the jaws close."""
    local = (target - T[:3, 3]) @ T[:3, :3]
    return np.asarray(target[int(np.argmin(local[:, 0] ** 2 + local[:, 2] ** 2))])
