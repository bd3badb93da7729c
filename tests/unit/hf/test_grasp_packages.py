"""Contact-GraspNet and M2T2 behind the grasp tools: settings, frames, order, seeds, and errors in our words."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from gap_catalogue.shared import research_packages as published
from gap_hf.grasps import graspnet, m2t2
from gap_runtime.contracts.failures import BadRequestError, PerceptionError, ToolError
from gap_runtime.contracts.types import DepthImage, Mask, Matrix3x3, PointCloud
from tests.unit.hf import packages
from tests.unit.hf.packages import DOWN, Net, gripper_at

RNG = np.random.default_rng(0)
TARGET = RNG.uniform(-0.02, 0.02, (200, 3)) + np.array([0.0, 0.0, 0.6])
SCENE = np.concatenate([TARGET, RNG.uniform(-0.3, 0.3, (800, 3)) + np.array([0.0, 0.0, 0.7])])
TIP = (0.01, 0.0, 0.6)
ONE = ([gripper_at(TIP)], [0.9], [TIP])
CTX = SimpleNamespace(seed=3)


@pytest.fixture(autouse=True)
def _fresh(monkeypatch):
    monkeypatch.setenv("GAP_HF_DEVICE", "cpu")
    published.forget()
    yield
    published.forget()


def weights():
    net = Net()
    net.weight.data[:] = 7.0
    return {"model": net.state_dict()}


@pytest.fixture
def contact_graspnet(monkeypatch, tmp_path):
    def start(*answers):
        (tmp_path / "checkpoints").mkdir()
        torch.save(weights(), tmp_path / "checkpoints" / "model.pt")
        monkeypatch.setenv(graspnet.CHECKPOINT, str(tmp_path))
        return packages.contact_graspnet(monkeypatch, answers)

    return start


@pytest.fixture
def scene_network(monkeypatch, tmp_path):
    def start(objects):
        torch.save(weights(), tmp_path / "m2t2.pth")
        (tmp_path / "config.yaml").write_text("m2t2: {}\n")
        monkeypatch.setenv(m2t2.CHECKPOINT, str(tmp_path / "m2t2.pth"))
        return packages.m2t2(monkeypatch, objects)

    return start


def on_segment(**options):
    return graspnet.plan_from_clouds(
        CTX, **{"full_cloud": PointCloud(SCENE), "segment_cloud": PointCloud(TARGET), **options}
    )


def in_scene(**options):
    return m2t2.plan_in_scene(CTX, **{"scene_cloud": PointCloud(SCENE), **options})


def same_tcp(pose, tip, R=DOWN):
    T = pose.matrix
    assert np.allclose(T[:3, 3], tip, atol=1e-6)
    assert np.allclose(T[:3, 2], R[:, 2], atol=1e-6), "z approaches in both"
    assert np.allclose(T[:3, 1], R[:, 0], atol=1e-6), "our y closes, theirs is x"
    assert np.linalg.det(T[:3, :3]) == pytest.approx(1)


@pytest.mark.parametrize("yaw", [0, 30, 200])
def test_poses_are_the_tcp_in_our_convention(contact_graspnet, scene_network, yaw):
    R = Rotation.from_euler("z", yaw, degrees=True).as_matrix() @ DOWN
    answer = ([gripper_at(TIP, R)], [0.9], [TIP])
    contact_graspnet(answer)
    same_tcp(on_segment().grasp_poses[0], TIP, R)
    scene_network([answer])
    same_tcp(in_scene().grasp_poses[0], TIP, R)


def test_best_first_with_their_contacts(contact_graspnet, scene_network):
    tips = [(0.0, 0.0, 0.59 + 0.01 * k) for k in range(3)]
    answer = ([gripper_at(t) for t in tips], [0.2, 0.9, 0.5], tips)
    contact_graspnet(answer)
    scene_network([([gripper_at(tips[0])], [0.2], tips[:1]), ([gripper_at(t) for t in tips[1:]], [0.9, 0.5], tips[1:])])
    for found in (on_segment(), in_scene()):
        assert found.scores == pytest.approx([0.9, 0.5, 0.2])
        assert [c.z for c in found.contact_points] == pytest.approx([0.60, 0.61, 0.59])
    assert in_scene(max_grasps=1).scores == pytest.approx([0.9])


def test_the_weights_are_loaded_once_and_not_in_training(contact_graspnet, scene_network):
    for calls, ask in ((contact_graspnet(ONE), on_segment), (scene_network([ONE]), in_scene)):
        ask(), ask()
        assert [(c.weight, c.trained) for c in calls] == [(7.0, False)] * 2


def test_a_scene_and_its_segment_arrive_within_the_range(contact_graspnet):
    (call,) = [contact_graspnet(ONE), on_segment(z_max=0.75)][0]
    assert call.regions and call.filtered
    assert np.allclose(call.segments[1], TARGET) and len(call.full) == (SCENE[:, 2] <= 0.75).sum()


def test_depth_becomes_the_same_clouds(contact_graspnet):
    calls = contact_graspnet(ONE)
    depth, mask = np.full((40, 40), 0.5), np.zeros((40, 40), bool)
    depth[0, 0], mask[10:20, 10:30] = np.nan, True
    K = np.array([[50.0, 0, 20], [0, 50, 20], [0, 0, 1]])
    graspnet.plan_from_depth(CTX, depth=DepthImage(depth), intrinsics=Matrix3x3(K), segmentation=Mask(mask))
    assert len(calls[0].full) == 1599 and len(calls[0].segments[1]) == 200


def test_it_tries_again_with_another_sample_and_the_same_seeds(contact_graspnet):
    calls = contact_graspnet(([], [], []), ([], [], []), ONE)
    assert len(on_segment().scores) == 1 and len(calls) == 3
    first = [c.drawn for c in calls]
    assert len(set(first)) == 3
    calls.clear()
    on_segment()
    assert [c.drawn for c in calls] == first
    assert on_segment(max_retries=1).scores == pytest.approx([0.9]), "the stand-in answers from its last"


def test_the_global_random_numbers_go_on_as_if_nothing_was(contact_graspnet):
    contact_graspnet(ONE)
    np.random.seed(5)
    torch.manual_seed(5)
    expected = np.random.RandomState(5).random()
    on_segment()
    assert np.random.random() == expected and torch.rand(1) == torch.rand(1, generator=torch.Generator().manual_seed(5))


def test_nothing_is_printed(contact_graspnet, capsys):
    contact_graspnet(ONE)
    on_segment()
    assert capsys.readouterr().out == ""


def test_the_scene_is_sampled_centred_and_coloured_as_it_was_trained(scene_network):
    calls = scene_network([ONE])
    colours = np.full(SCENE.shape, 255, np.uint8)
    in_scene(scene_cloud=PointCloud(SCENE, colours), num_points=500, grasp_threshold=0.1)
    in_scene(num_points=5000)
    data, cfg = calls[0].data, calls[0].cfg
    assert data["inputs"].shape == (1, 500, 6) and data["points"].shape == (1, 500, 3)
    assert torch.allclose(data["points"] - data["inputs"][..., :3], torch.tensor(SCENE.mean(axis=0)).float(), atol=1e-5)
    assert torch.allclose(data["inputs"][..., 3:].mean((0, 1)), torch.tensor((1 - m2t2.MEAN) / m2t2.STD).float())
    assert (cfg.mask_thresh, cfg.world_coord, cfg.object_thresh) == (0.1, True, 0.4)
    assert bool(data["task_is_pick"]) and not bool(data["task_is_place"])
    assert calls[1].data["inputs"].shape == (1, 5000, 6) and not calls[1].data["inputs"][..., 3:].any()


def test_the_targets_grasps_are_those_that_touch_it(scene_network):
    far = (0.2, 0.2, 0.8)
    scene_network([([gripper_at(TIP), gripper_at(far)], [0.5, 0.9], [TIP, far])])
    assert in_scene().scores == pytest.approx([0.9, 0.5])
    assert in_scene(target_cloud=PointCloud(TARGET)).scores == pytest.approx([0.5])
    assert in_scene(target_cloud=PointCloud(TARGET + 5)).scores == []


def test_no_grasps_is_an_empty_answer(contact_graspnet, scene_network):
    contact_graspnet(([], [], []))
    scene_network([])
    assert on_segment() == ([], [], []) and in_scene() == ([], [], [])


@pytest.mark.parametrize(
    ("pose", "scores"), [(np.zeros((4, 4)), [0.9]), (gripper_at(TIP), [0.9, 0.8]), (gripper_at(TIP), [np.nan])]
)
def test_answers_it_cannot_use(contact_graspnet, pose, scores):
    contact_graspnet(([pose], scores, [TIP]))
    with pytest.raises(ToolError) as caught:
        on_segment()
    assert caught.value.code == "answer"


def test_what_a_package_raises_is_put_in_our_words(contact_graspnet, scene_network):
    contact_graspnet(ValueError("operands could not be broadcast"))
    scene_network(RuntimeError("CUDA error"))
    for ask, title in ((on_segment, "Contact-GraspNet"), (in_scene, "M2T2")):
        with pytest.raises(ToolError, match=f"{title} failed") as caught:
            ask()
        assert caught.value.code == "package" and "rror" in caught.value.detail["cause"]


def test_settings_that_lead_nowhere(monkeypatch, tmp_path):
    for ask, variable, kind in ((on_segment, graspnet.CHECKPOINT, "folder"), (in_scene, m2t2.CHECKPOINT, "file")):
        with pytest.raises(ToolError, match=f"{variable} must name .* {kind}"):
            ask()
        monkeypatch.setenv(variable, str(tmp_path / "absent"))
        with pytest.raises(ToolError, match=f"not a {kind}"):
            ask()
    monkeypatch.setenv(graspnet.CHECKPOINT, str(tmp_path))
    with pytest.raises(ToolError, match=r"checkpoints/model\.pt"):
        on_segment()
    (tmp_path / "m2t2.pth").write_bytes(b"")
    monkeypatch.setenv(m2t2.CHECKPOINT, str(tmp_path / "m2t2.pth"))
    with pytest.raises(ToolError, match=f"{m2t2.CONFIG} must name"):
        in_scene()


def test_without_the_package_it_says_where_to_get_it(monkeypatch, tmp_path):
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "model.pt").write_bytes(b"")
    monkeypatch.setenv(graspnet.CHECKPOINT, str(tmp_path))
    with pytest.raises(ToolError, match="Contact-GraspNet cannot be imported") as caught:
        on_segment()
    assert caught.value.code == "extra" and "contact_graspnet_pytorch" in (caught.value.hint or "")


def test_weights_of_something_else(contact_graspnet, tmp_path):
    contact_graspnet(ONE)
    torch.save({"model": {"other": torch.zeros(1)}}, tmp_path / "checkpoints" / "model.pt")
    with pytest.raises(ToolError) as caught:
        on_segment()
    assert caught.value.code == "package"


def test_requests_they_will_not_send():
    with pytest.raises(BadRequestError):
        on_segment(instance_id=2)
    with pytest.raises(BadRequestError):
        in_scene(max_grasps=0)
    with pytest.raises(PerceptionError, match="0 usable points"):
        on_segment(segment_cloud=PointCloud(np.full((50, 3), np.nan)))
    with pytest.raises(PerceptionError, match="3 usable points"):
        in_scene(scene_cloud=PointCloud(SCENE[:3]))
    with pytest.raises(BadRequestError):
        graspnet.plan_from_depth(
            CTX,
            depth=DepthImage(np.ones((4, 4))),
            intrinsics=Matrix3x3(np.eye(3)),
            segmentation=Mask(np.ones((5, 5), bool)),
        )
