"""A small file of every format with an inventory, and a change of each field that it uses."""

import json
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from endotsr.clips.formats import calibration_fields, matlab_calibrations
from endotsr.clips.formats.calibrations import calibrated
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import describe, nerfstudio

WIDTH, HEIGHT, FRAMES = 32, 24, 3
K = [[30.0, 0, 15.0], [0, 31.0, 11.0], [0, 0, 1]]
Keys = dict[str, Any]
NO_KEYS: Keys = {}


class Format(NamedTuple):
    """How a format is tried."""

    inventory: Inventory
    base: Keys  # a file with every used field, as far as they go together
    write: Callable[[Path, Keys], None]  # the keys as files in a folder
    read: Callable[[Path], object]  # what the reader makes of the folder; equal for equal results
    changed: Keys  # name of a used field -> another value; None: the field is left out
    refused: Keys  # name of a refused field -> a value that is refused
    told: Keys = NO_KEYS  # name of a field that is not applied -> a value that a note tells
    start: Keys = NO_KEYS  # a used field that takes the place of others -> the value with which `changed` is compared


def result(clip: Clip) -> object:
    """Everything that a clip says, comparable."""
    first = next(clip.pictures([0])).left
    arrays = [clip.masks and clip.masks(0), clip.depth and clip.depth(0), clip.points and clip.points(0)]
    arrays += [value for f in fields(clip) if isinstance(value := getattr(clip, f.name), np.ndarray)]
    return (clip.names, clip.intrinsics, first.tobytes(), clip.unit, clip.rate, clip.baseline,
            [None if a is None else np.asarray(a).tobytes() for a in arrays],
            None if clip.poses is None else [p and (p.rotation.tobytes(), p.translation.tobytes()) for p in clip.poses],
            )  # fmt: skip


def pictures(folder: Path, inner: str) -> None:
    """Three pictures and their masks and depth."""
    for part in (inner, "masks", "planes"):
        (folder / part).mkdir(exist_ok=True)
    rng = np.random.default_rng(1)
    for i in range(FRAMES + 1):
        write_png(folder / inner / f"{i:03d}.png", rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8))
        write_png(
            folder / "masks" / f"{i:03d}.png", np.where(rng.random((HEIGHT, WIDTH)) < 0.5, 0, 255).astype(np.uint8)
        )
        write_png(folder / "planes" / f"{i:03d}.png", rng.integers(1, 999, (HEIGHT, WIDTH)).astype(np.uint16))
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    (folder / "cloud.ply").write_text(head + "1 2 3\n")
    (folder / "other.ply").write_text(head + "1 2 4\n")


def entry(i: int) -> Keys:
    """A frame of transforms.json."""
    pose = np.eye(4)
    pose[0, 3] = i
    return {"file_path": f"images/{i:03d}.png", "transform_matrix": pose.tolist(), "time": 0.1 * i,
            "mask_path": f"masks/{i:03d}.png", "depth_file_path": f"planes/{i:03d}.png"}  # fmt: skip


CAMERA = {"camera_model": "OPENCV", "fl_x": 30.0, "fl_y": 31.0, "cx": 15.0, "cy": 11.0, "w": WIDTH, "h": HEIGHT,
          "k1": 0.1, "k2": 0.01, "p1": 1e-3, "p2": 2e-3, "k3": 1e-3}  # fmt: skip
OTHER = {"camera_model": "EQUIRECTANGULAR", "fl_x": 31.0, "fl_y": 30.0, "cx": 16.0, "cy": 12.0, "w": 64, "h": 48,
         "k1": 0.2, "k2": 0.02, "p1": 2e-3, "p2": 1e-3, "k3": 2e-3, "camera_angle_x": 1.1,
         "camera_angle_y": 0.8}  # fmt: skip
NOT_PINHOLE = {"k4": 0.1, "k5": 0.1, "k6": 0.1, "is_fisheye": True, "ftheta_p0": 1.0, "latlong": True,
               "equirectangular": True, "fisheye_crop_radius": 9, "rolling_shutter": [0, 0, 0, 1.0], "x_fov": 50,
               "y_fov": 40}  # fmt: skip


def write_transforms(folder: Path, keys: Keys) -> None:
    """transforms.json with its pictures. An angle replaces the focal length; points are named without depth."""
    pictures(folder, "images")
    data = {name: value for name, value in keys.items() if value is not None}
    frames = data.setdefault("frames", [entry(i) for i in range(FRAMES)])
    if "camera_angle_x" in data or "camera_angle_y" in data:
        for name in ("fl_x", "fl_y", "cx", "cy"):
            data.pop(name, None)
        data.setdefault("camera_angle_x", 1.0)
    if "ply_file_path" in data:
        for one in frames:
            one.pop("depth_file_path", None)
    (folder / "transforms.json").write_text(json.dumps(data))


def write_entry(folder: Path, keys: Keys) -> None:
    """transforms.json whose frames have these keys; `file_path` and `transform_matrix` count from the first."""
    frames = [entry(i) | {name: value for name, value in keys.items() if name not in entry(i)} for i in range(FRAMES)]
    for name in entry(0):
        for i, one in enumerate(frames):
            if name not in keys or keys[name] is None:
                one.pop(name)
            elif callable(keys[name]):
                one[name] = keys[name](i)
    write_transforms(folder, {"frames": frames})


def turned(i: int) -> list[list[float]]:
    return [[0, -1, 0, i], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


FRAME_CHANGES = {name: value for name, value in OTHER.items() if not name.startswith("camera_angle")} | {
    "file_path": lambda i: f"images/{i + 1:03d}.png", "transform_matrix": turned, "time": lambda i: 0.1 * i * i,
    "mask_path": lambda i: f"masks/{i + 1:03d}.png", "depth_file_path": lambda i: f"planes/{i + 1:03d}.png",
}  # fmt: skip


def write_yaml(folder: Path, keys: Keys) -> None:
    (folder / "file.yaml").write_text(yaml.safe_dump({k: v for k, v in keys.items() if v is not None}))


def write_chain(folder: Path, keys: Keys) -> None:
    """A camchain whose second camera has the keys; the first has none of the pose."""
    first = {"camera_model": "pinhole", "intrinsics": [30, 31, 15, 11], "resolution": [WIDTH, HEIGHT],
             "distortion_model": "radtan", "distortion_coeffs": [0.1, 0.01, 0.0, 0.0]}  # fmt: skip
    write_yaml(folder, {"cam0": first, "cam1": {k: v for k, v in keys.items() if v is not None}})


def write_ini(folder: Path, keys: Keys) -> None:
    """Both sections with the same keys."""
    lines = [f"{name} = {value}" for name, value in keys.items() if value is not None]
    text = "\n".join(["[StereoLeft]", *lines, "[StereoRight]", *lines])
    (folder / "file.ini").write_text(text)


def stated(folder: Path) -> object:
    """What a calibration states, comparable."""
    file = next(folder.glob("file.*"), folder)
    camera, pair, baseline, _ = calibrated(file, WIDTH, HEIGHT)
    both = pair and (pair.left, pair.right, pair.rotation.tolist(), pair.translation.tolist())
    return camera, both, baseline


def flat(rows: list[list[float]]) -> list[float]:
    return [value for row in rows for value in row]


def write_ros_pair(folder: Path, keys: Keys) -> None:
    """left.yaml and right.yaml; the keys are those of the right camera."""
    base = ROS_BASE | {"rectification_matrix": {"data": flat(np.eye(3).tolist())}}
    for side, found in (("left", base), ("right", keys)):
        text = yaml.safe_dump({k: v for k, v in found.items() if v is not None})
        (folder / f"{side}.yaml").write_text(text)


ROS_BASE = {
    "image_width": WIDTH, "image_height": HEIGHT, "distortion_model": "plumb_bob", "camera_matrix": {"data": flat(K)},
    "distortion_coefficients": {"data": [0.1, 0.0, 0.0, 0.0, 0.0]},
    "rectification_matrix": {"data": flat(np.eye(3).tolist())},
    "projection_matrix": {"data": [30.0, 0, 15, -0.12, 0, 30, 11, 0, 0, 0, 1, 0]},
}  # fmt: skip
ROS_CHANGES = {
    "image_width": 2 * WIDTH, "image_height": 2 * HEIGHT, "distortion_model": "equidistant",
    "camera_matrix": {"data": [33.0, 0, 15, 0, 31, 11, 0, 0, 1]},
    "distortion_coefficients": {"data": [0.2, 0, 0, 0, 0]},
    "rectification_matrix": {"data": [0.0, -1, 0, 1, 0, 0, 0, 0, 1]},
    "projection_matrix": {"data": [30.0, 0, 15, -0.2, 0, 30, 11, 0, 0, 0, 1, 0]},
}  # fmt: skip
ECHO = {"width": WIDTH, "height": HEIGHT, "distortion_model": "plumb_bob", "K": flat(K), "D": [0.1, 0, 0, 0, 0],
        "R": flat(np.eye(3).tolist()), "P": [30.0, 0, 15, 0, 0, 30, 11, 0, 0, 0, 1, 0]}  # fmt: skip
ECHO_CHANGES = {"width": 64, "height": 48, "distortion_model": "equidistant", "K": [33.0, 0, 15, 0, 31, 11, 0, 0, 1],
                "D": [0.2, 0, 0, 0, 0]}  # fmt: skip
PAIR = {"M1": {"data": flat(K)}, "D1": {"data": [0.1, 0, 0, 0]}, "M2": {"data": flat(K)},
        "D2": {"data": [0.1, 0, 0, 0]}, "R": {"data": flat(np.eye(3).tolist())}, "T": {"data": [-4.0, 0, 0]},
        "image_width": WIDTH, "image_height": HEIGHT}  # fmt: skip
PAIR_CHANGES = {"M1": {"data": [33.0, 0, 15, 0, 31, 11, 0, 0, 1]}, "D1": {"data": [0.2, 0, 0, 0]},
                "M2": {"data": [33.0, 0, 15, 0, 31, 11, 0, 0, 1]}, "D2": {"data": [0.2, 0, 0, 0]},
                "R": {"data": [1.0, 0, 0, 0, 0, -1, 0, 1, 0]}, "T": {"data": [-5.0, 0, 0]}, "image_width": 64,
                "image_height": 48}  # fmt: skip
PLAIN = {"fx": 30.0, "fy": 31.0, "cx": 15.0, "cy": 11.0, "width": WIDTH, "height": HEIGHT} | {
    name: 0.01 for name in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")}  # fmt: skip
PLAIN_CHANGES = {name: 2 * value for name, value in PLAIN.items()}
CHAIN = {"camera_model": "pinhole", "intrinsics": [30, 31, 15, 11], "resolution": [WIDTH, HEIGHT],
         "distortion_model": "radtan", "distortion_coeffs": [0.1, 0.01, 0.0, 0.0],
         "T_cn_cnm1": [[1, 0, 0, -0.004], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}  # fmt: skip
CHAIN_CHANGES = {"camera_model": "omni", "intrinsics": [33, 31, 15, 11], "resolution": [64, 48],
                 "distortion_model": "equidistant", "distortion_coeffs": [0.2, 0.01, 0.0, 0.0],
                 "T_cn_cnm1": [[1, 0, 0, -0.005], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}  # fmt: skip
INI = {"res_x": WIDTH, "res_y": HEIGHT, "fc_x": 30, "fc_y": 31, "cc_x": 15, "cc_y": 11} | {
    f"kc_{k}": 0.01 for k in range(8)
} | {f"R_{k}": int(k % 4 == 0) for k in range(9)} | {"T_0": -4.2, "T_1": 0.1, "T_2": 0.1}  # fmt: skip
INI_CHANGES = {"res_x": 64, "res_y": 48, "fc_x": 33, "fc_y": 33, "cc_x": 16, "cc_y": 12} | {
    f"kc_{k}": 0.02 for k in range(8)
} | {f"R_{k}": 0.5 for k in range(9)} | {"T_0": -5, "T_1": 0.2, "T_2": 0.2}  # fmt: skip


def write_mat(folder: Path, keys: Keys) -> None:
    """file.mat with these variables."""
    from scipy.io import savemat

    savemat(folder / "file.mat", {name: value for name, value in keys.items() if value is not None})


def write_mat_cameras(folder: Path, keys: Keys) -> None:
    """A pair of MATLAB whose cameras have these fields."""
    both = {name: value for name, value in keys.items() if value is not None}
    write_mat(folder, MAT_PAIR | {"CameraParameters1": both, "CameraParameters2": both})


MAT_CAMERA = {"IntrinsicMatrix": np.array(K).T, "RadialDistortion": [[0.1, 0.01]], "ImageSize": [[HEIGHT, WIDTH]],
              "TangentialDistortion": [[0.0, 1e-3]], "WorldUnits": "mm"}  # fmt: skip
OTHER_K = np.array([[33.0, 0, 15], [0, 31, 11], [0, 0, 1]])
MAT_CAMERA_CHANGES = {"IntrinsicMatrix": OTHER_K.T, "K": OTHER_K, "Intrinsics": {"K": OTHER_K}, "WorldUnits": "m",
                      "RadialDistortion": [[0.2, 0.01]], "TangentialDistortion": [[1e-3, 0.0]],
                      "ImageSize": [[2 * HEIGHT, 2 * WIDTH]]}  # fmt: skip
MAT_PAIR = {"CameraParameters1": MAT_CAMERA, "CameraParameters2": MAT_CAMERA, "RotationOfCamera2": np.eye(3),
            "TranslationOfCamera2": [[-4.0, 0.0, 0.0]]}  # fmt: skip
MAT_PAIR_CHANGES = {"CameraParameters1": MAT_CAMERA | {"IntrinsicMatrix": OTHER_K.T},
                    "CameraParameters2": MAT_CAMERA | {"IntrinsicMatrix": OTHER_K.T},
                    "RotationOfCamera2": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
                    "TranslationOfCamera2": [[-5.0, 0.0, 0.0]]}  # fmt: skip
TOOLBOX = {"nx": WIDTH, "ny": HEIGHT, "R": np.eye(3), "T": [[-4.0], [0.0], [0.0]]} | {
    f"{name}{side}": value for side in ("_left", "_right")
    for name, value in (("fc", [[30.0], [31.0]]), ("cc", [[15.0], [11.0]]), ("kc", [[0.1], [0], [0], [0], [0]]))
}  # fmt: skip
TOOLBOX_CHANGES = {"nx": 64, "ny": 48, "R": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]), "T": [[-5.0], [0], [0]]} | {
    f"{name}{side}": value for side in ("_left", "_right")
    for name, value in (("fc", [[33.0], [31.0]]), ("cc", [[16.0], [11.0]]), ("kc", [[0.2], [0], [0], [0], [0]]))
}  # fmt: skip

FORMATS = {
    "nerfstudio": Format(nerfstudio.FIELDS, CAMERA, write_transforms, lambda folder: result(describe(folder)),
                         OTHER | {"frames": [entry(1), entry(2)], "ply_file_path": "cloud.ply",
                                  "applied_scale": 2.0},
                         NOT_PINHOLE | {"from_mitsuba": True, "integer_depth_scale": 0.001,
                                        "n_extra_learnable_dims": 4},
                         start={"camera_angle_x": 1.0, "camera_angle_y": 0.7, "ply_file_path": "other.ply"}),
    "nerfstudio frame": Format(nerfstudio.FRAME_FIELDS, {name: lambda i, n=name: entry(i)[n] for name in entry(0)}
                               | CAMERA, write_entry, lambda folder: result(describe(folder)), FRAME_CHANGES,
                               NOT_PINHOLE | {"depth_path": "planes/000.png"}),
    "kalibr": Format(calibration_fields.KALIBR, CHAIN, write_chain, stated, CHAIN_CHANGES, {"line_delay": 1e-5}),
    "ros": Format(calibration_fields.ROS, ROS_BASE, write_ros_pair, stated, ROS_CHANGES,
                  {"binning_x": 2, "binning_y": 2, "roi": {"x_offset": 8}}),
    "ros echo": Format(calibration_fields.ROS, ECHO, write_yaml, stated, ECHO_CHANGES,
                       {"binning_x": 2, "binning_y": 2, "roi": {"x_offset": 8}}),
    "opencv": Format(calibration_fields.OPENCV, PAIR, write_yaml, stated, PAIR_CHANGES,
                     {"fisheye_model": 1, "xi": 0.9, "model": "fisheye", "skew": 0.1}),
    "flat": Format(calibration_fields.FLAT, PLAIN, write_yaml, stated, PLAIN_CHANGES,
                   {"fisheye": True, "model": "kannala_brandt4", "skew": 0.1, "coeffs": [0.1, 0, 0, 0]}),
    "matlab": Format(matlab_calibrations.CAMERA, MAT_CAMERA, write_mat_cameras, stated,
                     MAT_CAMERA_CHANGES,
                     {"Skew": 0.1, "MappingCoefficients": [[800.0, 0, 0, 0]], "StretchMatrix": [[1.0, 0], [0, 1]],
                      "DistortionCenter": [[15.0, 11]]}),
    "matlab pair": Format(matlab_calibrations.PAIR, MAT_PAIR, write_mat, stated, MAT_PAIR_CHANGES, {}),
    "bouguet": Format(matlab_calibrations.BOUGUET, TOOLBOX, write_mat, stated, TOOLBOX_CHANGES,
                      {"alpha_c_left": 0.1, "alpha_c_right": 0.1}),
    "ini": Format(calibration_fields.INI, INI, write_ini, stated, INI_CHANGES, {"skew": 0.1}),
}  # fmt: skip
