"""A simulated scene as a raw recording in the layout of StereoMIS, with its ground truth.

    simulated.mp4             left picture over right, one pair per frame
    StereoCalibration.ini     both cameras, OpenCV's convention; R and T of x_right = R x_left + T, millimetres
    groundtruth.txt           frame tx ty tz qx qy qz qw: camera-to-world, metres
    masks/000123l.png         of the left picture, any value above 0 = tissue; only where there are instruments
    truth/                    see truth.py

In: settings. Out: files, one frame at a time. The cameras form an ideal pair, rectified and without distortion. The
video is compressed like real recordings, or lossless; a lossless video has the pictures of `write_sequence`.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from endotsr.clips.simulator.field_of_view import check_field_of_view
from endotsr.clips.simulator.folder import check_split, frames_with_truth
from endotsr.clips.simulator.frames import SimulatedScene, make_scene
from endotsr.clips.simulator.instrument import graspers
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array
from endotsr.method.splatting.camera import camera_centre

VIDEO, CALIBRATION, TRAJECTORY, MASKS = "simulated.mp4", "StereoCalibration.ini", "groundtruth.txt", "masks"
RATE = 25.0  # frames per second
METRE = 1000.0  # millimetres


def check_recording(settings: SimulatorSettings) -> None:
    """Raises InputError for settings that cannot become such a recording. Nothing is rendered."""
    if not settings.stereo.on:
        raise InputError("simulator: stereo.on = False does not fit the layout stereomis; use True")
    if settings.width % 2:
        raise InputError(f"simulator: width = {settings.width} does not fit a video; use even numbers")
    check_split(settings)
    check_field_of_view(settings)


def write_recording(
    folder: Path,
    settings: SimulatorSettings,
    name: str = "",
    on_frame: Callable[[], object] = lambda: None,
    lossless: bool = False,
) -> None:
    """Write a recording and its truth into an existing, empty folder. `on_frame` is called after every frame.

    lossless  a lossless video, more than ten times as large

    Raises:  InputError as `check_recording` does, or where the settings fold the tissue over itself.
    """
    from endotsr.clips.formats.film_file import write_video

    check_recording(settings)
    scene = make_scene(settings)
    (folder / CALIBRATION).write_text(calibration_text(scene), encoding="utf-8", newline="\n")
    (folder / TRAJECTORY).write_text(trajectory_text(scene), encoding="utf-8", newline="\n")
    write_video(folder / VIDEO, _stacked(folder, scene, name, on_frame), RATE, lossless)


def _stacked(folder: Path, scene: SimulatedScene, name: str, on_frame: Callable[[], object]) -> Iterator[Array]:
    """The pictures of the video, (2H, W, 3) uint8. Masks and truth are written at the same time."""
    from endotsr.clips.opencv.png import write_png

    masked = bool(graspers(scene.settings))
    if masked:
        (folder / MASKS).mkdir()
    for i, frame in enumerate(frames_with_truth(folder, scene, name)):
        assert frame.image_right is not None
        if masked:
            write_png(folder / MASKS / f"{i:06d}l.png", np.where(frame.excluded, 0, 255).astype(np.uint8))
        yield np.concatenate([frame.image, frame.image_right], axis=1).transpose(1, 2, 0)
        on_frame()


def calibration_text(scene: SimulatedScene) -> str:
    """The ini file. Its principal point is relative to the centre of the first pixel, as in OpenCV."""
    camera = scene.cameras[0]
    numbers = {
        "res_x": camera.width, "res_y": camera.height, "fc_x": camera.fx, "fc_y": camera.fy,
        "cc_x": camera.cx - 0.5, "cc_y": camera.cy - 0.5, **{f"kc_{k}": 0.0 for k in range(8)},
    }  # fmt: skip
    pose = {f"R_{k}": float(value) for k, value in enumerate(np.eye(3).ravel())}
    pose |= {"T_0": -scene.settings.stereo.baseline, "T_1": 0.0, "T_2": 0.0}
    lines = []
    for section, entries in (("StereoLeft", numbers), ("StereoRight", numbers | pose)):
        lines += [f"[{section}]", *(f"{key} = {value!r}" for key, value in entries.items()), ""]
    return "\n".join(lines)


def trajectory_text(scene: SimulatedScene) -> str:
    """One line per frame, at full precision."""
    from scipy.spatial.transform import Rotation

    lines = []
    for i, camera in enumerate(scene.cameras):
        place = camera_centre(camera) / METRE
        turn = Rotation.from_matrix(camera.rotation.T).as_quat()
        lines.append(" ".join([str(i), *(repr(float(value)) for value in (*place, *turn))]))
    return "\n".join(lines) + "\n"
