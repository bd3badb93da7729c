"""Stand-ins for the research packages: the published modules' names, signatures and shapes, and answers one chooses."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import torch
from scipy.spatial.transform import Rotation

DEPTH = 0.1034
DOWN = Rotation.from_euler("x", np.pi).as_matrix()


def gripper_at(tip, R=DOWN):
    """The base of a gripper whose fingertips meet at a point: x closes, z approaches, as build_6d_grasp makes it."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, np.asarray(tip) - R[:, 2] * DEPTH
    return T


def install(monkeypatch, **modules):
    """Make modules importable by their dotted names, given with `__` for a dot."""
    for name, content in modules.items():
        dotted = name.replace("__", ".")
        module = ModuleType(dotted)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, dotted, module)
        if "." in dotted and dotted.partition(".")[0] not in sys.modules:
            monkeypatch.setitem(sys.modules, dotted.partition(".")[0], ModuleType(dotted.partition(".")[0]))


class Net(torch.nn.Module):
    """One weight, so that a checkpoint can fit or not."""

    def __init__(self, *_):
        super().__init__()
        self.weight = torch.nn.Parameter(torch.zeros(1))


def contact_graspnet(monkeypatch, answers):
    """contact_graspnet_pytorch: `answers` is a list of (poses, scores, contacts), one per call; returns the calls."""
    calls = []

    class GraspEstimator:
        def __init__(self, cfg):
            print("model func:", cfg)
            self.device, self.model = torch.device("cpu"), Net()

        def predict_scene_grasps(self, pc_full, pc_segments=None, local_regions=False, filter_grasps=False):
            print("using local regions")
            drawn = float(np.random.random())
            calls.append(
                SimpleNamespace(
                    full=pc_full, segments=pc_segments, regions=local_regions, filtered=filter_grasps, drawn=drawn,
                    trained=self.model.training, weight=float(self.model.weight),
                )
            )  # fmt: skip
            answer = answers[min(len(calls), len(answers)) - 1]
            if isinstance(answer, Exception):
                raise answer
            poses, scores, contacts = answer
            return (
                {1: np.asarray(poses, np.float32).reshape(-1, 4, 4)}, {1: np.asarray(scores, np.float32)},
                {1: np.asarray(contacts, np.float32)}, {1: np.full(len(scores), 0.08)},
            )  # fmt: skip

    def load_config(checkpoint_dir, batch_size=None, arg_configs=()):
        return {"dir": checkpoint_dir, "OPTIMIZER": {"batch_size": batch_size}}

    install(
        monkeypatch,
        contact_graspnet_pytorch__contact_grasp_estimator={"GraspEstimator": GraspEstimator},
        contact_graspnet_pytorch__config_utils={"load_config": load_config},
    )
    return calls


class Settings(SimpleNamespace):
    """What of an OmegaConf node is used: attributes and a copy."""

    def copy(self):
        return Settings(**vars(self))


def m2t2(monkeypatch, objects):
    """m2t2: `objects` is a list of (poses, scores, contacts), one per object it finds; returns the calls of infer."""
    calls = []

    class M2T2(Net):
        @classmethod
        def from_config(cls, cfg):
            assert cfg.scene_encoder == "pointnet2_msg"
            return cls()

        def infer(self, data, cfg):
            calls.append(SimpleNamespace(data=data, cfg=cfg, trained=self.training, weight=float(self.weight)))
            if isinstance(objects, Exception):
                raise objects
            return {
                key: [[torch.as_tensor(np.asarray(part[i], np.float32)) for part in objects]]
                for i, key in enumerate(("grasps", "grasp_confidence", "grasp_contacts"))
            }

    evaluation = Settings(mask_thresh=0.4, object_thresh=0.4, world_coord=False, placement_height=0.02)
    loaded = SimpleNamespace(m2t2=SimpleNamespace(scene_encoder="pointnet2_msg"), eval=evaluation)
    install(
        monkeypatch,
        m2t2__m2t2={"M2T2": M2T2},
        omegaconf={"OmegaConf": SimpleNamespace(load=lambda path: loaded)},
    )
    return calls
