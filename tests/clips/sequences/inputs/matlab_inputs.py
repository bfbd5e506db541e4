"""Rows of `inputs_tried.py` about MAT-files: calibrations of MATLAB and of Bouguet's toolbox, and depth."""

import struct
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import Row, baseline, centred, depth_files, depth_is_true, files, prepare
from left_inputs import MOVED
from made_videos import pictures
from scipy.io import savemat

K = np.array(
    [[100.0, 0, 64.5], [0, 101, 48.5], [0, 0, 1]]
)  # the middle of 128x96 pixels whose first has its centre at 1
CAMERA = {
    "RadialDistortion": np.array([[0.0, 0.0]]), "TangentialDistortion": np.array([[0.0, 0.0]]),
    "ImageSize": np.array([[96.0, 128.0]]), "WorldPoints": np.random.default_rng(0).random((54, 2)),
    "WorldUnits": "millimeters", "EstimateSkew": np.array([[0]], np.uint8), "NumRadialDistortionCoefficients": 2.0,
    "EstimateTangentialDistortion": np.array([[0]], np.uint8), "RotationVectors": np.zeros((9, 3)),
    "TranslationVectors": np.zeros((9, 3)), "ReprojectionErrors": np.zeros((54, 2, 9)), "IntrinsicMatrix": K.T,
    "Version": {"Name": "MATLAB", "Version": "9.13", "Release": "(R2022b)", "Date": "13-May-2022"},
}  # fmt: skip
PAIR = {
    "CameraParameters1": CAMERA, "CameraParameters2": CAMERA, "RotationOfCamera2": np.eye(3),
    "TranslationOfCamera2": np.array([[-4.0, 0.0, 0.0]]), "Version": CAMERA["Version"],
}  # fmt: skip
BOUGUET = {
    "fc_left": np.array([[100.0], [100.0]]), "cc_left": np.array([[63.5], [47.5]]), "kc_left": np.zeros((5, 1)),
    "alpha_c_left": 0.0, "fc_right": np.array([[100.0], [100.0]]), "cc_right": np.array([[63.5], [47.5]]),
    "kc_right": np.zeros((5, 1)), "alpha_c_right": 0.0, "R": np.eye(3), "T": np.array([[-4.0], [0.0], [0.0]]),
    "om": np.zeros((3, 1)), "nx": 128.0, "ny": 96.0, "fc_left_error": np.ones((2, 1)),
}  # fmt: skip


def element(kind: int, content: bytes) -> bytes:
    """An element of a MAT-file of version 5."""
    return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)


def opaque(path: Path) -> None:
    """An object of a class, as `save` writes stereoParams itself."""
    head = b"MATLAB 5.0 MAT-file, Platform: PCWIN64".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    flags = element(6, struct.pack("<II", 17, 0))
    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 6, 1)) + element(1, b"")
    numbers = element(14, inner + element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1)))
    words = b"".join(element(1, word) for word in (b"stereoParams", b"MCOS", b"stereoParameters"))
    path.write_bytes(head + element(14, flags + words + numbers))


def deep(path: Path, levels: int = 4000) -> None:
    """Cells within one another."""
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    made = element(14, element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 0, 0)) + element(1, b"a"))
    for _ in range(levels):
        cell = element(6, struct.pack("<II", 1, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"c")
        made = element(14, cell + made)
    path.write_bytes(head + made)


def of_7_3(path: Path) -> None:
    path.write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n" + b"\0" * 99)


def saved(variables, **how):
    """A writer of variables as a MAT-file."""

    return lambda path: savemat(path, variables, **how)


@builder
def mat(folder: Path, write, *words: str, pair: bool = False, name: str = "calibration.mat") -> list[str]:
    """Pictures, or pairs of pictures, with a calibration in a MAT-file."""
    files(folder, "one", pictures())
    files(folder, "other", MOVED)
    write(folder / name)
    right = ("--right", str(folder / "other")) if pair else ()
    return prepare("one", *right, "--calibration", str(folder / name), *words, camera=())(folder)


def depth_in_mat(frames: int = 1):
    """MAT-files of so many frames each."""

    def save(path: Path, plane: np.ndarray) -> None:
        stored = plane if frames == 1 else np.stack([plane] * frames, axis=2)
        savemat(path, {"depth": stored.astype(np.float32), "unit": "mm"}, do_compression=True)

    return depth_files(save, ".mat")


def paired(folder: Path) -> bool:
    return baseline(4.0)(folder) and centred(folder)


IN_METRES = PAIR | {"CameraParameters1": CAMERA | {"WorldUnits": "m"}, "TranslationOfCamera2": [[-0.004, 0.0, 0.0]]}
SQUARE = {"CameraParameters1": CAMERA | {"IntrinsicMatrix": np.diag([1, 100 / 101, 1]) @ K.T},
          "CameraParameters2": CAMERA | {"IntrinsicMatrix": np.diag([1, 100 / 101, 1]) @ K.T}}  # fmt: skip
INTRINSICS = {"FocalLength": [[100.0, 101.0]], "PrincipalPoint": [[64.5, 48.5]], "ImageSize": [[96.0, 128.0]],
              "RadialDistortion": [[0.0, 0.0, 0.0]], "Skew": 0.0, "K": K}  # fmt: skip
MATLAB_ROWS = [
    Row("calibration, cameraParameters of MATLAB as a struct", mat(saved({"cameraParams": CAMERA})), "told",
        "half a pixel was added", centred),
    Row("calibration, cameraParameters of MATLAB with -struct, compressed", mat(saved(CAMERA, do_compression=True)),
        "told", "half a pixel was added", centred),
    Row("calibration, cameraIntrinsics of MATLAB", mat(saved({"intrinsics": INTRINSICS})), "told",
        "half a pixel was added", centred),
    Row("calibration, stereoParameters of MATLAB", mat(saved({"s": PAIR | SQUARE}), pair=True), "told",
        "rectified: baseline 4 mm", paired),
    Row("calibration, stereoParameters of MATLAB in metres", mat(saved(IN_METRES | {k: v | {"WorldUnits": "m"}
        for k, v in SQUARE.items()}), pair=True), "told", "rectified: baseline 4 mm", paired),
    Row("calibration, a field of MATLAB that is not known", mat(saved({"c": CAMERA | {"LensShading": 1.0}})), "told",
        "unknown here: LensShading", centred),
    Row("calibration, Calib_Results_stereo.mat", mat(saved(BOUGUET), pair=True), "told", "rectified: baseline 4 mm",
        paired),
    Row("calibration, matrices in a MAT-file", mat(saved({"K": K - [[0, 0, 1], [0, 0, 1], [0, 0, 0]], "D":
        np.zeros((1, 5))})), "told", "those of MATLAB's classes are 1 larger", centred),
    Row("calibration, a transposed matrix in a MAT-file", mat(saved({"K": K.T, "D": np.zeros((1, 5))})), "refused",
        "is the matrix transposed?"),
    Row("calibration, skew in MATLAB", mat(saved({"c": CAMERA | {"Skew": 0.2}})), "refused", "Skew = 0.2"),
    Row("calibration, fisheyeParameters of MATLAB", mat(saved({"c": {"MappingCoefficients": [[800.0, -1e-3, 0, 0]],
        "DistortionCenter": [[64.0, 48.0]], "ImageSize": [[96.0, 128.0]]}})), "refused", "fisheye"),
    Row("calibration, stereoParams itself in a MAT-file", mat(opaque), "refused", "toStruct(OBJECT)"),
    Row("calibration, a MAT-file of version 7.3", mat(of_7_3), "refused", "'-v7'"),
    Row("calibration, a MAT-file of version 4", mat(saved({"K": K}, format="4")), "refused", "'-v7'"),
    Row("calibration, cells within one another", mat(deep), "refused", "use at most 16 levels"),
    Row("calibration, two cameras in a MAT-file", mat(saved({"left": CAMERA, "right": CAMERA})), "refused",
        "2 calibrations"),
    Row("depth, one MAT-file for each frame", depth_in_mat(), "right", "", depth_is_true),
    Row("depth, several frames in a MAT-file", depth_in_mat(frames=6), "refused", "one file of (height, width)"),
]  # fmt: skip
