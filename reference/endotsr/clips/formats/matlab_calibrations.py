"""Calibrations of MATLAB in MAT-files: cameraParameters and stereoParameters as structs, and Bouguet's toolbox.

As in `calibration_formats`: a function per format returns None for a file in another one. MATLAB's classes place the
centre of the first pixel at (1, 1) and store the transposed matrix; Bouguet's toolbox has the conventions of OpenCV.
"""

from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.formats.calibration_formats import (
    Format,
    StoredCalibration,
    StoredIntrinsics,
    distortion_of,
)
from endotsr.clips.formats.inventory import Inventory
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.json import Keys
from endotsr.untrusted.matlab import read_mat
from endotsr.untrusted.names import choice
from endotsr.untrusted.yaml import matrix

OF_CALIBRATION = "it documents the calibration"
CAMERA = Inventory(
    "a camera of MATLAB: cameraParameters or cameraIntrinsics as a struct",
    used={
        "IntrinsicMatrix K Intrinsics FocalLength PrincipalPoint": "intrinsics, with the first pixel centre at (1, 1)",
        "RadialDistortion TangentialDistortion": "k1 k2 [k3] and p1 p2",
        "ImageSize": "height and width of the pictures",
        "WorldUnits": "unit of the distance between two cameras",
    },
    refused={
        "Skew": "square pixels alone are supported",
        "MappingCoefficients StretchMatrix DistortionCenter": "a fisheye model is not supported: undistort the pictures"
        " first",
    },
    harmless={
        "WorldPoints EstimateSkew NumRadialDistortionCoefficients EstimateTangentialDistortion ReprojectionErrors"
        " MeanReprojectionError DetectedKeypoints ReprojectedPoints NumPatterns PatternPositions"
        " Version": OF_CALIBRATION,
        "RotationVectors TranslationVectors RotationMatrices PatternExtrinsics": "the poses of the board do not concern"
        " the pictures of the clip",
    },
)
PAIR = Inventory(
    "a pair of MATLAB: stereoParameters as a struct",
    used={
        "CameraParameters1 CameraParameters2": "left and right camera, see there",
        "RotationOfCamera2 TranslationOfCamera2": "x_right = x_left R + t for rows, in WorldUnits",
    },
    harmless={
        "PoseCamera2": "it repeats RotationOfCamera2 and TranslationOfCamera2",
        "FundamentalMatrix EssentialMatrix RectificationParams": "it follows from both cameras, and is computed again",
        "MeanReprojectionError NumPatterns WorldPoints WorldUnits Version": OF_CALIBRATION,
    },
)
BOUGUET = Inventory(
    "Calib_Results.mat or Calib_Results_stereo.mat of Bouguet's toolbox",
    used={
        "fc cc fc_left cc_left fc_right cc_right": "intrinsics, pixel centres at integers",
        "kc kc_left kc_right": "k1 k2 p1 p2 k3",
        "R T": "pose of the right camera relative to the left, millimetres",
        "nx ny": "size of the pictures",
    },
    refused={"alpha_c alpha_c_left alpha_c_right": "square pixels alone are supported"},
    harmless={
        "KK* inv_KK* om *_error* *_std err_std solution* param* fc_hist": OF_CALIBRATION,
        "omc_* Rc_* Tc_* om_* R_* T_* H_* x_* X_* y_* Y_* ex_* dX* dY* n_sq_* wintx* winty* ind_* active_images*"
        " calib_name* format_image* image_numbers* type_numbering* N_slots* n_ima* est_* center_optim* recompute*"
        " check_cond* MaxIter* small_calib_image history* no_* min_* max_* map*": "boards and settings of the toolbox",
    },
)
UNITS = {"mm": 1.0, "millimeters": 1.0, "millimetres": 1.0, "cm": 10.0, "centimeters": 10.0, "m": 1000.0,
         "meters": 1000.0, "metres": 1000.0, "in": 25.4, "inches": 25.4, "um": 1e-3, "micrometers": 1e-3}  # fmt: skip
MARKS = ("IntrinsicMatrix", "K", "FocalLength", "Intrinsics", "MappingCoefficients")
LARGEST_FILE = 1 << 26  # bytes, unpacked; Bouguet's toolbox also saves the corners of the boards
FROM_ONE = "cameras of MATLAB count pixels from 1: 1 was subtracted from cx and cy first"
SAME = 1e-6  # relative difference of intrinsics that are stated twice


def matlab_keys(path: Path) -> Keys:
    """The variables of a MAT-file with lists in place of arrays, as other calibration files give them."""
    return _with_lists(read_mat(path, LARGEST_FILE))


def _with_lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_lists(one) for name, one in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value


def read_matlab(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera or a pair of MATLAB's classes, saved as a struct or with its fields as variables.

    Raises:  InputError for several calibrations in a file, another camera model, and a unit that is not known.
    """
    if path.suffix.lower() != ".mat":
        return None
    if _is_calibration(keys):
        found = [(f"{path}", keys)]
    else:
        found = [(f"{path}: {name}", one) for name, one in keys.items() if _is_calibration(one)]
    if not found:
        return None
    if len(found) > 1:
        raise InputError(f"{path}: {len(found)} calibrations; use one camera or one pair in a file")
    where, one = found[0]
    if "CameraParameters1" not in one:
        left, notes, _ = _camera(one, where)
        return StoredCalibration(left, notes=(FROM_ONE, *notes))
    notes = [FROM_ONE, *PAIR.noted(one, where)]
    for name in ("CameraParameters2", "RotationOfCamera2", "TranslationOfCamera2"):
        if name not in one:
            raise InputError(f"{where}: {name} is missing; a pair has both cameras, its rotation and its translation")
    (left, more, unit), (right, others, _) = (
        _camera(one[name], f"{where}: {name}") for name in ("CameraParameters1", "CameraParameters2")
    )
    turn = matrix(one["RotationOfCamera2"], f"{where}: RotationOfCamera2", (3, 3)).T
    shift = unit * matrix(one["TranslationOfCamera2"], f"{where}: TranslationOfCamera2", (3,))
    return StoredCalibration(left, right, turn, shift, notes=(*notes, *more, *others))


def _is_calibration(keys: Any) -> bool:
    """Whether a mapping is one camera or one pair."""
    named = ("CameraParameters1", "RadialDistortion", "MappingCoefficients", "IntrinsicMatrix")
    return isinstance(keys, dict) and any(name in keys for name in named)


def _camera(keys: Any, where: str) -> tuple[StoredIntrinsics, list[str], float]:
    """One camera, notes, and millimetres per unit of length."""
    if not isinstance(keys, dict) or not any(name in keys for name in MARKS):
        raise InputError(f"{where}: use a struct with IntrinsicMatrix, K, or FocalLength and PrincipalPoint")
    notes = CAMERA.noted(keys, where)
    found = _matrix_of(keys, where)
    found[:2, 2] -= 1.0  # the first pixel centre is at (1, 1)
    radial = matrix(keys.get("RadialDistortion", [0.0, 0.0]), f"{where}: RadialDistortion", (-1,)).tolist()
    across = matrix(keys.get("TangentialDistortion", [0.0, 0.0]), f"{where}: TangentialDistortion", (2,)).tolist()
    if len(radial) not in (2, 3):
        raise InputError(f"{where}: RadialDistortion: {len(radial)} numbers; use 2 or 3")
    bent = distortion_of(np.array([*radial[:2], *across, *radial[2:]]), f"{where}: distortion")
    unit = str(keys.get("WorldUnits", "mm")).lower()
    if unit not in UNITS:
        raise InputError(f"{where}: WorldUnits {unit[:40]!r}; use {choice(UNITS)}")
    stated = keys.get("ImageSize")
    size = None if stated is None or not np.size(stated) else matrix(stated, f"{where}: ImageSize", (2,)).astype(int)
    return StoredIntrinsics(found, bent, None if size is None else (int(size[1]), int(size[0]))), notes, UNITS[unit]


def _matrix_of(keys: Keys, where: str) -> FloatArray:
    """K, which newer versions store upright and older ones transposed. Raises InputError if two fields differ."""
    found = []
    inner = keys["Intrinsics"] if isinstance(keys.get("Intrinsics"), dict) else {}
    for name in ("IntrinsicMatrix", "K"):
        for one in (keys, inner):
            if name in one:
                stored = matrix(one[name], f"{where}: {name}", (3, 3))
                found.append(stored.T.copy() if stored[2, :2].any() else stored.copy())
    for one in (keys, inner):
        if "FocalLength" in one and "PrincipalPoint" in one:
            (fx, fy), (cx, cy) = (matrix(one[name], f"{where}: {name}", (2,)) for name in ("FocalLength",
                                  "PrincipalPoint"))  # fmt: skip
            found.append(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]]))
    if not found:
        raise InputError(f"{where}: use IntrinsicMatrix, K, or FocalLength and PrincipalPoint")
    if any(np.abs(other - found[0]).max() > SAME * np.abs(found[0]).max() for other in found):
        raise InputError(f"{where}: IntrinsicMatrix, K, FocalLength and PrincipalPoint differ; use one camera")
    return found[0]


def read_bouguet(path: Path, keys: Keys) -> StoredCalibration | None:
    """One camera or a pair of Bouguet's toolbox. Raises InputError for a part that is missing."""
    if path.suffix.lower() != ".mat":
        return None
    if {"fc_left", "fc_right"} <= set(keys):
        sides = ("_left", "_right")
    elif {"fc", "cc"} <= set(keys):
        sides = ("",)
    else:
        return None
    notes = tuple(BOUGUET.noted(keys, path))
    size = None
    if "nx" in keys and "ny" in keys:
        width, height = (int(matrix([keys[name]], f"{path}: {name}", (1,))[0]) for name in ("nx", "ny"))
        size = width, height
    cameras = []
    for side in sides:
        (fx, fy), (cx, cy) = (matrix(keys.get(f"{name}{side}"), f"{path}: {name}{side}", (2,)) for name in ("fc", "cc"))
        bent = matrix(keys.get(f"kc{side}", [0.0] * 4), f"{path}: kc{side}", (-1,))
        found = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
        cameras.append(StoredIntrinsics(found, distortion_of(bent, f"{path}: kc{side}"), size))
    if len(cameras) == 1:
        return StoredCalibration(cameras[0], notes=notes)
    turn, shift = matrix(keys.get("R"), f"{path}: R", (3, 3)), matrix(keys.get("T"), f"{path}: T", (3,))
    return StoredCalibration(cameras[0], cameras[1], turn, shift, notes=notes)


FORMATS = (
    Format("FILE.mat with stereoParameters or cameraParameters of MATLAB as a struct, in WorldUnits", read_matlab),
    Format("Calib_Results.mat or Calib_Results_stereo.mat of Bouguet's toolbox, millimetres", read_bouguet),
)
