"""A simulated scene as a sequence folder in the EndoNeRF layout, with its ground truth.

    images/ images_right/     left and right picture          poses_bounds.npy   LLFF rows
    depth/                    prior depth, whole millimetres, 16 bits
    masks/ gt_masks/          white = excluded: instruments and, with a right picture, pixels without prior depth;
                              instruments alone
    truth/                    see truth.py

In: settings. Out: files, one frame at a time. Reading the folder gives the sequence of `simulate` with the same
settings, bit for bit and including the prior depth, if `sequence.depth_percentiles` is 0 to 100.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import TRUTH
from endotsr.clips.sequences.poses import POSE_FILES, rows_from_cameras
from endotsr.clips.sequences.splits import split_frames
from endotsr.clips.simulator.cameras import camera_centres
from endotsr.clips.simulator.field_of_view import check_field_of_view
from endotsr.clips.simulator.frames import SimulatedFrame, SimulatedScene, make_scene, simulated_frames
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.shading import lit_by_all, shade
from endotsr.clips.simulator.trajectories import empty_tracks, follow
from endotsr.clips.simulator.truth import write_frame, write_scene
from endotsr.clips.simulator.views import see_rays, view_of_points
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray

PICTURES = ("images", "images_right", "depth", "masks", "gt_masks")
DEEPEST = np.iinfo(np.uint16).max  # mm
TRACKS = (24, 19)  # tracked points, evenly spaced over the first picture, across and down


def check_scene(settings: SimulatorSettings) -> None:
    """Raises InputError for settings that cannot become a sequence folder. Nothing is rendered."""
    part = settings.depth_rounding
    if not part.on or part.step != round(part.step):
        found = f"depth_rounding.step = {part.step:g}" if part.on else "depth_rounding.on = False"
        raise InputError(f"simulator: {found} does not fit a folder, which holds whole millimetres; use 1, 2, 3 ..")
    if not (settings.stereo.on or settings.instrument.on or settings.more_instruments.on):
        raise InputError(
            "simulator: a sequence without an excluded pixel is not read without a flag; use stereo, instrument or"
            " more_instruments on"
        )
    check_split(settings)
    check_field_of_view(settings)


def check_split(settings: SimulatorSettings) -> None:
    """Raises InputError for too few frames, or for a split of its own: files hold none, a training chooses it."""
    if settings.block_length:
        raise InputError(
            f"simulator: block_length = {settings.block_length} does not fit files, which hold no split; use 0,"
            f" and endotsr train --sequence.split blocks --sequence.block-length {settings.block_length}"
        )
    split_frames(settings.frames, "every_eighth", 0)


def write_sequence(
    folder: Path, settings: SimulatorSettings, name: str = "", on_frame: Callable[[], object] = lambda: None
) -> None:
    """Write a scene and its truth into an existing, empty folder. `on_frame` is called after every frame.

    Raises:  InputError as `check_scene` does, or where the settings fold the tissue over itself.
    """
    check_scene(settings)
    pictures = PICTURES if settings.stereo.on else tuple(n for n in PICTURES if n != "images_right")
    for inner in pictures:
        (folder / inner).mkdir(parents=True)
    scene = make_scene(settings)
    far = np.empty(settings.frames)
    for i, frame in enumerate(frames_with_truth(folder, scene, name)):
        _write_pictures(folder, i, frame)
        far[i] = frame.prior.max()
        on_frame()
    np.save(folder / POSE_FILES[0], pose_rows(scene, far))


def frames_with_truth(folder: Path, scene: SimulatedScene, name: str) -> Iterator[SimulatedFrame]:
    """The frames in order. Their truth is written into `folder` one frame at a time, the rest at the end.

    Raises:  InputError where the settings fold the tissue over itself.
    """
    for inner in ("frames", "instrument"):
        (folder / TRUTH / inner).mkdir(parents=True)
    tracks = empty_tracks(tracked_points(scene), scene.settings.frames)
    light = np.empty_like(tracks.position)
    for i, frame in enumerate(simulated_frames(scene)):
        write_frame(folder / TRUTH, i, frame)
        follow(tracks, i, scene.surface, scene.cameras[i], float(scene.times[i]), frame.covered)
        light[i] = tissue_light(scene, tracks.material, i)
        yield frame
    write_scene(folder / TRUTH, scene, name, tracks, light)


def tracked_points(scene: SimulatedScene) -> FloatArray:
    """The material points of the tracks, (2, P) mm, seen on an even grid of image positions of frame 0."""
    camera = scene.cameras[0]
    across, down = TRACKS
    x = (np.arange(across) + 0.5) / across * camera.width
    y = (np.arange(down) + 0.5) / down * camera.height
    u, v = (a.ravel() for a in np.meshgrid(x, y))
    return see_rays(scene.surface, camera, 0.0, (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy).material


def tissue_light(scene: SimulatedScene, material: FloatArray, i: int) -> FloatArray:
    """Linear light (3, P) that material points send to the camera of frame i.

    It includes lamps, brightening and blood, but no highlights, shadows, instruments, smoke, vignetting or gain.
    """
    settings = scene.settings
    plain = msgspec.structs.replace(settings, highlights=msgspec.structs.replace(settings.highlights, on=False))
    view = view_of_points(scene.surface, scene.cameras[i], material, float(scene.times[i]))
    lamps = lit_by_all(plain, view, scene.cameras[i])
    return shade(plain, scene.texture, view, lamps, float(scene.times[i])).light[:, 0]


def pose_rows(scene: SimulatedScene, far: FloatArray) -> FloatArray:
    """Pose rows (n, 17) from which the reader restores the cameras of the scene bit for bit."""
    rows = rows_from_cameras(scene.cameras, far)
    rows[:, :15].reshape(-1, 3, 5)[:, :, 3] = camera_centres(scene.settings, scene.times)
    return rows


def _write_pictures(folder: Path, i: int, frame: SimulatedFrame) -> None:
    from endotsr.clips.opencv.png import write_png

    name = f"{i:06d}.png"
    write_png(folder / "images" / name, frame.image.transpose(1, 2, 0))
    if frame.image_right is not None:
        write_png(folder / "images_right" / name, frame.image_right.transpose(1, 2, 0))
    write_png(folder / "depth" / name, _whole_millimetres(frame.prior, name))
    write_png(folder / "masks" / name, np.where(frame.tissue, 0, 255).astype(np.uint8))
    write_png(folder / "gt_masks" / name, np.where(frame.excluded, 255, 0).astype(np.uint8))


def _whole_millimetres(prior: NDArray[np.float32], name: str) -> NDArray[np.uint16]:
    """Levels of a picture of depth. Raises InputError for a depth beyond the largest level."""
    if prior.max() > DEEPEST:
        raise InputError(
            f"simulator: depth/{name}: the prior depth reaches {prior.max():.0f} mm; use at most {DEEPEST}, with a"
            " smaller distance, relief, depth_errors.sigma or depth_rounding.step"
        )
    return prior.astype(np.uint16)
