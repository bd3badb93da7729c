from dataclasses import replace

import numpy as np
import pytest

from gap_perception.bench.scenes import SCENE
from gap_runtime.contracts.access import node_scope
from gap_runtime.contracts.simulator import Instance
from gap_runtime.contracts.types import BoundingBox2D, Image, Quaternion, Se3Pose, Vec3

pytestmark = pytest.mark.sim


def label(cell, name):
    return cell.task.objects[name].label


def iou(a, b):
    return np.count_nonzero(a & b) / np.count_nonzero(a | b)


def test_every_object_in_view_is_found_once_and_no_other(cell, cameras, present):
    for name in cell.task.objects:
        found = cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt=label(cell, name)).detections
        assert len(found) == (name in present), name
        assert all(d.score > 0.8 and d.label == label(cell, name) for d in found)


@pytest.fixture(scope="module")
def shown(cell, present):
    """Which pixels truly show what, by camera and object."""
    return cell.cell.true_masks()


def test_detection_and_segmentation_cover_the_object(cell, shown, cameras, present):
    for camera in cameras:
        for name in present:
            true = shown[camera.name][name].data
            found = cell.tool("grounding_dino.Detect", image=camera.rgb, text_prompt=label(cell, name)).detections
            if true.sum() < 200:
                continue
            masks, scores = cell.tool("sam3.SegmentBox", image=camera.rgb, box=found[0].box)
            assert iou(masks[0].data, true) > 0.9 and scores[0] > 0.9, (camera.name, name)


def test_the_fused_cloud_gives_the_box(cell, cameras, present, truth):
    for name in present:
        clouds = []
        for camera in cameras:
            for d in cell.tool("grounding_dino.Detect", image=camera.rgb, text_prompt=label(cell, name)).detections:
                mask = cell.tool("sam3.SegmentBox", image=camera.rgb, box=d.box).masks[0]
                clouds.append(
                    cell.tool(
                        "geometry_svc.MaskToWorldPoints", mask=mask, depth=camera.depth,
                        intrinsics=camera.intrinsics, camera_pose=camera.pose,
                    ).points
                )  # fmt: skip
        points, body = np.concatenate(clouds), truth.bodies[name]
        half = np.abs(body.box.orientation.rotation.as_matrix()) @ body.box.extent.array
        assert np.all(np.abs(points - body.box.center.array) <= half + 0.002), name
        assert np.allclose(points.max(axis=0) - points.min(axis=0), 2 * half, atol=0.025), name


def test_phrases_are_periods_apart_and_unknown_ones_find_nothing(cell, cameras):
    found = cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt="unicorn. basket. ").detections
    assert [d.label for d in found] == ["basket"]


def test_owlvit_answers_as_grounding_dino(cell, cameras):
    a = cell.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt="basket.").detections
    assert a == cell.tool("owlvit.Detect", image=cameras[0].rgb, text_queries=["basket"]).detections


def test_text_point_and_box_give_the_same_segment(cell, cameras):
    image = cameras[0].rgb
    by_text = cell.tool("sam3.SegmentText", image=image, text_prompt="basket")
    x, y, found = cell.tool("molmo.PointPrompt", image=image, object_name="basket")
    assert found and by_text.masks[0].data[y, x]
    for point in ("sam2.SegmentPoint", "sam3.SegmentPoint"):
        assert cell.tool(point, image=image, pixel_x=x, pixel_y=y).masks == by_text.masks
    for box in ("sam2.SegmentBox", "sam3.SegmentBox"):
        assert cell.tool(box, image=image, box=by_text.boxes[0]).masks[:1] == by_text.masks


def test_a_box_on_a_part_gives_the_part(cell, cameras):
    image = cameras[0].rgb
    whole = cell.tool("sam3.SegmentText", image=image, text_prompt="basket").masks[0].data
    x, y, _ = cell.tool("molmo.PointPrompt", image=image, object_name="basket")
    part = BoundingBox2D(x - 8, y - 8, x + 8, y + 8)
    mask = cell.tool("sam3.SegmentBox", image=image, box=part).masks[0].data
    assert 0 < mask.sum() <= 16 * 16 and not (mask & ~whole).any()


def test_the_bare_floor_is_no_segment(cell, cameras):
    image, rows = cameras[0].rgb, cameras[0].rgb.data.shape[0]
    corner = BoundingBox2D(5, rows - 40, 60, rows - 5)
    assert cell.tool("sam3.SegmentBox", image=image, box=corner).masks == []
    assert cell.tool("sam3.SegmentPoint", image=image, pixel_x=20, pixel_y=rows - 20).masks == []


def test_a_crop_shows_what_was_cut_out(cell, cameras):
    image = cameras[0].rgb
    box = cell.tool("grounding_dino.Detect", image=image, text_prompt="basket").detections[0].box
    x0, y0, x1, y1 = (int(v) for v in (box.x_min, box.y_min, box.x_max, box.y_max))
    crop = Image(image.data[y0:y1, x0:x1])
    inside = cell.tool("grounding_dino.Detect", image=crop, text_prompt="basket").detections[0].box
    assert inside == BoundingBox2D(0, 0, x1 - x0, y1 - y0)
    assert cell.tool("vlm.Query", prompt="What is this?", image=crop).text == "basket"


def test_an_image_never_observed_is_judged_by_colour_and_less_surely(cell, cameras, present):
    known = cell.tool("grounding_dino.Detect", image=cameras[1].rgb, text_prompt="basket").detections
    cell.state.clear()
    unknown = cell.tool("grounding_dino.Detect", image=cameras[1].rgb, text_prompt="basket").detections
    assert 0.2 < unknown[0].score < known[0].score
    a, b = (np.array([d.box.x_min, d.box.y_min, d.box.x_max, d.box.y_max]) for d in (known[0], unknown[0]))
    assert np.abs(a - b).max() < 12


def test_something_without_a_model_is_not_taken_for_a_model(cell, cameras, present):
    """Taken out of the task's objects it is still in the picture, and is nothing then."""
    gone = next(n for n in present if cell.task.objects[n].shape.kind == "cylinder")
    task = cell.task.model_copy(update={"objects": {n: m for n, m in cell.task.objects.items() if n != gone}})
    stranger = replace(cell, task=task, state={})
    stranger.tool("observation.GetObservation")
    for name in task.objects:
        found = stranger.tool("grounding_dino.Detect", image=cameras[0].rgb, text_prompt=label(cell, name)).detections
        assert len(found) == (name in present), name


def test_what_is_inside_the_basket_is_found_there(cell, present, truth):
    """It stands on the basket's floor, no support of the cell, and little of it shows."""
    name = next(n for n in present if cell.task.objects[n].shape.kind == "cylinder")
    basket = truth.bodies["basket"].pose.position
    inside = Vec3(
        basket.x, basket.y, cell.task.objects["basket"].shape.floor + cell.task.objects[name].shape.size[2] / 2
    )
    before = cell.cell.snapshot()
    poses = {n: b.pose for n, b in before.bodies.items()}
    try:
        cell.cell.reset(Instance(0, SCENE, poses | {name: Se3Pose(inside, Quaternion(1, 0, 0, 0))}))
        cell.state.clear()
        with node_scope("test"):
            frames = cell.tool("observation.GetObservation").cameras
            question = f"Is the {label(cell, name)} in the basket?"
            assert cell.tool("molmo.QueryYesNo", prompt=question, image=frames[1].rgb, use_multiview=True).answer
            assert cell.tool("vlm.Query", prompt="Is the basket in the basket?", image=frames[1].rgb).text == "no"
    finally:
        cell.cell.reset(Instance(0, SCENE, poses))
