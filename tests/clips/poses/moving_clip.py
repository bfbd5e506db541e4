"""A small simulated clip of a moving scope in front of tissue that does not move, with its true poses."""

from functools import cache

import numpy as np

import endotsr
from endotsr.clips.opencv.png import write_png
from endotsr.clips.poses.views import Views, compose, inverse
from endotsr.clips.sequences.sequence_file import (
    CameraEntry,
    DepthEntry,
    MaskEntry,
    SequenceFile,
    write_sequence_file,
)
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import with_settings
from endotsr.method.splatting.camera import CameraPose

SIZE = SimulatorSettings(width=160, height=120, frames=14)
SWING = 10.0  # mm


@cache
def moving_sequence(*effects, seed=0):
    """The sequence; effects beside the moving camera and noise."""
    settings = with_effects(with_settings(SIZE, seed=seed), "camera_motion", "noise", *effects)
    return simulate(with_settings(settings, camera_motion={"amplitude": SWING})).sequence


def moving_views(*effects, seed=0):
    """The views, and the true poses."""
    found = moving_sequence(*effects, seed=seed)
    poses = [CameraPose(camera.rotation, camera.translation) for camera in found.cameras]
    return Views(found.images, found.masks, found.depth, found.cameras[0]), poses


def still_views():
    """A scope at rest in front of tissue that is pulled, moves and beats."""
    found = simulate(with_effects(SIZE, "breathing", "pulsation", "pull", "noise")).sequence
    return Views(found.images, found.masks, found.depth, found.cameras[0])


def centres(poses):
    """Optical centres (n, 3)."""
    return np.array([-pose.rotation.T @ pose.translation for pose in poses])


def path_error(poses, true):
    """RMS distance of the centres, mm, with the first poses on top of each other."""
    common = compose(inverse(true[0]), poses[0])
    moved = [compose(pose, inverse(common)) for pose in poses]
    return float(np.sqrt(np.square(centres(moved) - centres(true)).sum(1).mean()))


@cache
def hand_held(frames=24):
    """A hand-held scope in front of tissue that does not move, 320x256: views, and the true poses."""
    settings = with_effects(SimulatorSettings(width=320, height=256, frames=frames), "camera_motion", "noise")
    path = {"path": "hand", "amplitude": 8.0, "cycles": frames / 24}
    found = simulate(with_settings(settings, camera_motion=path)).sequence
    poses = [CameraPose(camera.rotation, camera.translation) for camera in found.cameras]
    return Views(found.images, found.masks, found.depth, found.cameras[0]), poses


def written(folder, views, depth=True, unit="mm", assumed=""):
    """A folder in the common format without poses."""
    for name in ("images", "masks", *(["depth"] if depth else [])):
        (folder / name).mkdir(parents=True)
    for k in range(views.count):
        write_png(folder / "images" / f"{k:06d}.png", np.ascontiguousarray(views.images[k].transpose(1, 2, 0)))
        write_png(folder / "masks" / f"{k:06d}.png", np.where(views.tissue[k], 0, 255).astype(np.uint8))
        if depth:
            write_png(folder / "depth" / f"{k:06d}.png", np.rint(100 * views.depth[k]).astype(np.uint16))
    c = views.camera
    entry = CameraEntry(width=c.width, height=c.height, fx=c.fx, fy=c.fy, cx=c.cx, cy=c.cy)
    stated = DepthEntry(scale=0.01, unit=unit, assumed=assumed) if depth else None
    write_sequence_file(
        SequenceFile(
            format="endotsr-sequence-1", frames=views.count, camera=entry, depth=stated, unit=unit, masks=MaskEntry()
        ),
        folder,
    )
    return folder


def poses_of(folder):
    """The poses of the sequence in a folder."""
    found = endotsr.load_sequence(folder, allow_tissue_fraction=True)
    return [CameraPose(camera.rotation, camera.translation) for camera in found.cameras]


def path_error_up_to_scale(poses, true):
    """RMS distance of the centres, mm, after the best similarity; and the scale."""
    a, b = centres(poses), centres(true)
    a, b = a - a.mean(axis=0), b - b.mean(axis=0)
    u, s, v = np.linalg.svd(b.T @ a)
    flip = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    factor = np.trace(flip @ np.diag(s)) / np.square(a).sum()
    return float(np.sqrt(np.square(factor * a @ (u @ flip @ v).T - b).sum(1).mean())), float(factor)


def without_pose(poses):
    """Frames without a pose."""
    return [k for k, pose in enumerate(poses) if pose is None]
