"""Renders for the right camera of a rectified pair, compared with the real right pictures, which training never reads.

A prior depth from stereo matching rests on these pictures, and the training uses it.

The stereo baseline B is the median of d z / f over tissue pixels, with disparity d and prior depth z of the left
pictures. If the quartiles of B differ too much, the pair is not calibrated and is not measured. The right camera is the
left one translated by B along its x axis.

Evaluated pixels: every left pixel is warped to the right picture by its prior depth; of several, the nearest in depth
is kept. A left pixel without depth is warped by the depth of the nearest pixel with one. A right pixel is evaluated if
the left pixel that it then shows is tissue and has a depth of its own, except in a margin along the border of these
pixels. This choice does not depend on a model.

At held-out times the moved left picture is itself held out, and a model does not see it. A prediction that sees what a
model sees is the optical flow between the neighbouring left pictures, moved by the blend of their prior depths.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.sequences.sampling import even_frames
from endotsr.clips.sequences.sequence import IN_MEMORY, Sequence
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.baselines import flow_interpolation, unit_image
from endotsr.results.evaluation.depth import blended_prior
from endotsr.results.evaluation.evaluate import training_sample
from endotsr.results.evaluation.metrics import psnr_tissue, ssim_tissue
from endotsr.results.evaluation.records import Measured, MeasureRow
from endotsr.training.runs.sources import SIMULATED
from endotsr.untrusted.names import counted

FOLDER = "images_right"
MATCHED_FRAMES = 5  # number of frames for the stereo baseline
SEARCHED = 4  # disparities up to 1 / SEARCHED of the width
SPREAD = 0.15  # largest (third - first quartile) / median of the baseline for a calibrated pair
FLOW = "flow between the neighbours, moved by the blend of their depths"
MARGIN = 3  # px removed at the border of the evaluated region
LEAST_PIXELS = 100  # tissue pixels with disparity and depth


class Moved(NamedTuple):
    """A left picture warped to the right camera."""

    picture: FloatArray  # (3, H, W) display units
    counted: BoolArray  # (H, W) True = evaluated


def right_view(
    sequence: Sequence, source: str, settings: SequenceConfig, render: Callable[[int, Camera], RenderOut]
) -> Measured:
    """PSNR (dB) and SSIM over the evaluated pixels, for the held-out frames and every sixth training frame.

    source   sequence folder with images_right/
    render   frame number and camera -> render
    returns  {"baseline", "spread", "unit", "rows": [{"label", "held_out_psnr", "held_out_ssim", "training_psnr",
             "training_ssim"}]} for the model, the warped left picture, the warped flow between its neighbours (at
             held-out times alone), and the unchanged left picture; or {"reason"}
    """
    folder = Path(source) / FOLDER
    if source in (SIMULATED, IN_MEMORY) or not folder.is_dir():  # these words name no folder
        return {"reason": f"the sequence has no {FOLDER}/"}
    right = _right_pictures(folder, sequence, settings)
    found = stereo_baseline(sequence, right)
    if found is None:
        return {"reason": "left and right pictures have too few common pixels with depth"}
    baseline, spread = found
    if not baseline > 0 or spread > SPREAD:
        return {"reason": f"disparity and depth give no consistent baseline ({baseline:.3g}, spread {spread:.0%})"}
    rows: dict[str, MeasureRow] = {}
    for part, frames in (("held_out", sequence.test_index), ("training", training_sample(sequence))):
        values = [_frame(sequence, int(i), baseline, right(i), render, part == "held_out") for i in frames]
        for label in values[0] if values else ():
            psnr, ssim = np.array([value[label] for value in values]).T
            row = rows.setdefault(label, {"label": label})
            row |= {f"{part}_psnr": _mean(psnr), f"{part}_ssim": _mean(ssim)}
    return {"baseline": baseline, "spread": spread, "unit": sequence.unit, "rows": list(rows.values())}


def right_camera(camera: Camera, baseline: float) -> Camera:
    """The camera moved by the baseline along its own x axis."""
    return camera._replace(translation=camera.translation - np.array([baseline, 0.0, 0.0]))


def stereo_baseline(sequence: Sequence, right: Callable[[int], NDArray[np.uint8]]) -> tuple[float, float] | None:
    """Median of d z / f over tissue pixels of several frames, and its relative spread; None with too few pixels.

    right   frame number -> right picture (3, H, W)
    """
    from endotsr.clips.opencv.stereo import match_pair

    count = max(16, sequence.width // SEARCHED // 16 * 16)
    found = []
    for i in even_frames(sequence.count, MATCHED_FRAMES):
        left, other = (np.ascontiguousarray(p.transpose(1, 2, 0)) for p in (sequence.images[i], right(i)))
        match = match_pair(left, other, 0, count, smooth=False)
        known = np.isfinite(match.raw) & (match.disagreement <= 1) & sequence.masks[i] & (sequence.depth[i] > 0)
        found.append(match.raw[known] * sequence.depth[i][known] / sequence.cameras[i].fx)
    values = np.concatenate(found)
    if values.size < LEAST_PIXELS:
        return None
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    return float(middle), float((high - low) / middle) if middle > 0 else float("inf")


def moved_left(sequence: Sequence, index: int, baseline: float) -> Moved:
    """The left picture warped by its prior depth; holes are 0 and not evaluated."""
    from scipy.ndimage import binary_erosion

    from endotsr.clips.opencv.flow import sample_bilinear

    depth, mask = sequence.depth[index], sequence.masks[index]
    height, width = mask.shape
    if not (depth > 0).any():
        return Moved(np.zeros((3, height, width), np.float32), np.zeros(mask.shape, bool))
    x, seen = _shown_columns(depth, sequence.cameras[index].fx * baseline)
    rows = np.indices(mask.shape)[0]
    at = np.clip(np.rint(x).astype(int), 0, width - 1)
    counted = seen & (x <= width - 1) & mask[rows, at] & (depth[rows, at] > 0)
    kept: BoolArray = np.asarray(binary_erosion(counted, iterations=MARGIN)).astype(bool)
    picture = sample_bilinear(unit_image(sequence, index), x, rows.astype(float))
    return Moved(np.where(seen, picture, 0).astype(np.float32), kept)


def moved_flow(sequence: Sequence, index: int, baseline: float) -> FloatArray:
    """The flow between the neighbouring training frames, warped by the blend of their prior depths.

    returns   (3, H, W) display units; a hole has the colour of the nearest pixel that is shown, and without any depth
              the picture is not warped
    """
    from endotsr.clips.opencv.flow import sample_bilinear

    predicted, depth = flow_interpolation(sequence, index), blended_prior(sequence, index)
    if not (depth > 0).any():
        return predicted
    x, seen = _shown_columns(depth, sequence.cameras[index].fx * baseline)
    picture = sample_bilinear(predicted, x, np.indices(seen.shape)[0].astype(float)).astype(np.float32)
    return picture[:, *_nearest(seen)]


def _shown_columns(depth: FloatArray, focal_baseline: float) -> tuple[NDArray[np.float64], BoolArray]:
    """The column of the left picture that every pixel of the right one shows, and whether one shows there; (H, W).

    depth            (H, W) of the left picture, positive somewhere; a pixel without one has that of the nearest pixel
    focal_baseline   f B, px times scene units
    """
    filled = depth[_nearest(depth > 0)]
    height, width = depth.shape
    rows, columns = np.indices((height, width))
    there = np.rint(columns - focal_baseline / filled).astype(int)
    inside = there >= 0
    front = np.full(depth.shape, np.inf, np.float32)
    np.minimum.at(front, (rows[inside], there[inside]), filled[inside])
    seen: BoolArray = np.isfinite(front)
    return np.where(seen, columns + focal_baseline / np.where(seen, front, 1), columns), seen


def _nearest(known: BoolArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row and column of the nearest known pixel, for every pixel; (H, W) each."""
    from scipy.ndimage import distance_transform_edt

    found = distance_transform_edt(~known, return_distances=False, return_indices=True)
    rows, columns = np.asarray(found, np.intp)
    return rows, columns


def _frame(
    sequence: Sequence,
    index: int,
    baseline: float,
    right: NDArray[np.uint8],
    render: Callable[[int, Camera], RenderOut],
    held_out: bool,
) -> dict[str, tuple[float, float]]:
    """PSNR and SSIM of one frame by label."""
    truth = right.astype(np.float32) / np.float32(255)
    moved, camera = moved_left(sequence, index, baseline), right_camera(sequence.cameras[index], baseline)
    pictures = {
        "this model": np.clip(render(index, camera).colour, 0, 1),
        "left picture moved by the prior depth": moved.picture,
        **({FLOW: moved_flow(sequence, index, baseline)} if held_out else {}),
        "left picture as it is": unit_image(sequence, index),
    }
    return {
        label: (psnr_tissue(picture, truth, moved.counted), ssim_tissue(picture, truth, moved.counted))
        for label, picture in pictures.items()
    }


def _right_pictures(folder: Path, sequence: Sequence, settings: SequenceConfig) -> Callable[[int], NDArray[np.uint8]]:
    """Frame number -> right picture (3, H, W) in the size of the sequence; InputError if unreadable or smaller."""
    from endotsr.clips.formats.files import list_pictures
    from endotsr.clips.opencv.filters import area_resize
    from endotsr.clips.opencv.pictures import PICTURE_ENDINGS, read_picture
    from endotsr.clips.sequences.clip import colour_picture
    from endotsr.clips.sequences.splits import parse_frame_range

    files, width, height = list_pictures(folder, PICTURE_ENDINGS), sequence.width, sequence.height
    files = [files[i] for i in parse_frame_range(settings.frames, len(files))]
    if len(files) != sequence.count:
        raise InputError(
            f"{folder}: {counted(len(files), 'picture')} for {counted(sequence.count, 'frame')}; use one per frame"
        )

    def right(index: int) -> NDArray[np.uint8]:
        file = files[index]
        pixels = colour_picture(read_picture(file), file)
        if pixels.shape[0] < height or pixels.shape[1] < width:
            raise InputError(f"{file}: {pixels.shape[1]}x{pixels.shape[0]} pixels; use at least {width}x{height}")
        return np.ascontiguousarray(area_resize(pixels, width, height).transpose(2, 0, 1))

    return right


def _mean(values: NDArray[np.float64]) -> float | None:
    """Mean of the finite values; None without one."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else None
