"""One object followed through frames by SAM 3's memory (`Sam3TrackerVideoModel`), frame by frame as they come."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock
from typing import Any, NamedTuple

from gap_hf.loading import Network, network
from gap_hf.vision.pixels import HALVES, Square, to_array, to_image
from gap_hf.vision.promptable_segmentation import FOREGROUND, Prompt
from gap_runtime.contracts.failures import BadRequestError
from gap_runtime.contracts.types import Array, Image

OBJECT = 1  # a session follows one object
BOX_CORNERS = (2, 3)  # labels of a box's corners among the prompt points


class FollowedMask(NamedTuple):
    """The object in one frame: its mask of the frame's size, and the probability that it is in the frame."""

    mask: Array
    chance: float


@dataclass
class FollowedObject:
    """A session of the network and how far it has come; its lock keeps frames in order."""

    session: Any
    frame: int
    size: tuple[int, int]
    lock: Any


def load() -> Network:
    """The tracker. Raises what `loading.network` raises."""
    return network("sam3_tracker", "Sam3TrackerVideoModel")


def start(image: Image, prompt: Prompt, mask: Array | None = None) -> tuple[FollowedObject, FollowedMask]:
    """Start to follow what the prompt, or a mask (H, W), holds in the first frame."""
    import torch
    from transformers.models.sam3_tracker_video.modeling_sam3_tracker_video import Sam3TrackerVideoInferenceSession

    loaded = load()
    device = loaded.place.device
    rows, columns = image.data.shape[:2]
    session = Sam3TrackerVideoInferenceSession(
        video_height=rows, video_width=columns, inference_device=device, inference_state_device=device,
        video_storage_device=device, dtype=torch.float32,
    )  # fmt: skip
    index = session.obj_id_to_idx(OBJECT)
    square = _square(loaded)
    if mask is None:
        session.add_point_inputs(index, 0, _points(square, image, prompt, device))
    else:
        session.add_mask_inputs(index, 0, _stretched(square, mask, device))
    session.obj_with_new_inputs = [OBJECT]
    track = FollowedObject(session, 0, (rows, columns), Lock())
    return track, _step(loaded, track, image)


def follow(track: FollowedObject, image: Image) -> FollowedMask:
    """The object in the next frame. Raises `BadRequestError` (`shape`) for a frame of another size."""
    rows, columns = image.data.shape[:2]
    if (rows, columns) != track.size:
        height, width = track.size
        raise BadRequestError("shape", f"The tracker follows {width}x{height} frames; this one is {columns}x{rows}.")
    with track.lock:
        if track.session is None:
            raise BadRequestError("unknown_tracker", "The tracker was closed while this frame was waiting.")
        return _step(load(), track, image)


def stop(track: FollowedObject) -> None:
    """Free what the session holds."""
    with track.lock:
        track.session = None


def _step(loaded: Network, track: FollowedObject, image: Image) -> FollowedMask:
    with loaded.running() as model:
        pixels = _square(loaded).pixels(image, loaded.place.device)
        found = model(inference_session=track.session, frame=pixels, frame_idx=track.frame)
        _forget(track, model.config)
        mask = to_array(to_image(found.pred_masks[:, 0], image)[0] > 0)
        chance = float(found.object_score_logits.float().sigmoid().max())
    track.frame += 1
    return FollowedMask(mask, chance)


def _forget(track: FollowedObject, config: Any) -> None:
    """Drop what the network will not look at again: a long track must not fill the memory."""
    session = track.session
    session.processed_frames.clear()
    oldest = track.frame - max(config.num_maskmem, config.max_object_pointers_in_encoder)
    for outputs in session.output_dict_per_obj.values():
        for kind in outputs.values():
            for frame in kind.values():
                frame.pop("high_res_masks", None)
        for frame in [f for f in outputs["non_cond_frame_outputs"] if f < oldest]:
            del outputs["non_cond_frame_outputs"][frame]
    for tracked in session.frames_tracked_per_obj.values():
        for frame in [f for f in tracked if f < oldest]:
            del tracked[frame]


def _square(loaded: Network) -> Square:
    side = loaded.model.config.image_size
    return Square(int(side if isinstance(side, int) else side[0]), *HALVES)


def _points(square: Square, image: Image, prompt: Prompt, device: Any) -> dict[str, Any]:
    """The prompt as labelled points: corners of a box, a point on the object."""
    import torch

    xy: list[tuple[float, ...]] = []
    labels: list[int] = []
    if prompt.box is not None:
        xy, labels = [prompt.box[:2], prompt.box[2:]], [*BOX_CORNERS]
    if prompt.point is not None:
        xy, labels = [*xy, prompt.point], [*labels, FOREGROUND]
    coordinates = square.points(xy, image, device).view(1, 1, -1, 2)
    return {
        "point_coords": coordinates,
        "point_labels": torch.tensor(labels, dtype=torch.int32, device=device).view(1, 1, -1),
    }


def _stretched(square: Square, mask: Array, device: Any) -> Any:
    """A mask (H, W) on the network's square, (1, 1, side, side) of zeros and ones."""
    import torch

    whole = torch.from_numpy(mask.astype("float32")).to(device)[None, None]
    size = (square.side, square.side)
    whole = torch.nn.functional.interpolate(whole, size, mode="bilinear", align_corners=False, antialias=True)
    return (whole >= 0.5).float()
