"""Rows of `inputs_tried.py` about cameras and calibrations: numbers of a command line and files of other programs."""

import json
import pickle
import struct
from pathlib import Path

import numpy as np
from builders import builder
from calibration_files import kalibr, ros
from input_kinds import MATRIX, MOVED, P, Row, baseline, calibrated, centred, folder_of, prepare
from made_videos import CAMERA, HEIGHT, WIDTH, files, picture, pictures
from public_layouts import K
from scipy.io import savemat

from endotsr.clips.sequences.sequence_file import read_sequence_file


def ros_text(**changes) -> str:
    return ros(K, [0.0] * 5, **changes)


def kalibr_text(**changes) -> str:
    return kalibr(pair=False, distortion_coeffs=[0.0] * 4, **changes)


OPENCV = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]
"""


@builder
def with_camera(folder: Path, *camera) -> list[str]:
    files(folder, "clip", pictures())
    return prepare("clip", camera=("--camera", *camera))(folder)


ROS_ECHO = """header:
  seq: {seq}
  stamp: {{secs: {seq}, nsecs: 0}}
height: 96
width: 128
distortion_model: plumb_bob
D: [0.0, 0.0, 0.0, 0.0, 0.0]
K: [100.0, 0.0, 63.5, 0.0, 101.0, 47.5, 0.0, 0.0, 1.0]
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [100.0, 0.0, 63.5, 0.0, 0.0, 101.0, 47.5, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi: {{x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}}
---
"""
ORB = (
    "%YAML:1.0\nCamera.type: {}\nCamera.fx: 100.0\nCamera.fy: 101.0\nCamera.cx: 63.5\nCamera.cy: 47.5\nCamera.k1: {}\n"
)
EUROC = "sensor_type: camera\nresolution: [128, 96]\ncamera_model: pinhole\nintrinsics: [100, 101, 63.5, 47.5]\n"
FISHEYE = "K: {data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]}\nD: {data: [0.01, 0., 0., 0.]}\n"


def kitti_pair() -> str:
    across = [100.0, 0, 63.5, -0.4, 0, 101, 47.5, 0, 0, 0, 1, 0]
    own = across[:3] + [0.0] + across[4:]
    text = "\n".join(f"P{k}: {' '.join(map(str, row))}" for k, row in enumerate((own, across)))
    return text + "\nTr: 1 0 0 0 0 1 0 0 0 0 1 0\n"


K_FROM_1 = np.array(
    [[100.0, 0, 64.5], [0, 101, 48.5], [0, 0, 1]]
)  # the middle of 128x96 pixels whose first has its centre at 1
PARAMETERS = {
    "RadialDistortion": np.array([[0.0, 0.0]]), "TangentialDistortion": np.array([[0.0, 0.0]]),
    "ImageSize": np.array([[96.0, 128.0]]), "WorldPoints": np.random.default_rng(0).random((54, 2)),
    "WorldUnits": "millimeters", "EstimateSkew": np.array([[0]], np.uint8), "NumRadialDistortionCoefficients": 2.0,
    "EstimateTangentialDistortion": np.array([[0]], np.uint8), "RotationVectors": np.zeros((9, 3)),
    "TranslationVectors": np.zeros((9, 3)), "ReprojectionErrors": np.zeros((54, 2, 9)), "IntrinsicMatrix": K_FROM_1.T,
    "Version": {"Name": "MATLAB", "Version": "9.13", "Release": "(R2022b)", "Date": "13-May-2022"},
}  # fmt: skip
PAIR = {
    "CameraParameters1": PARAMETERS, "CameraParameters2": PARAMETERS, "RotationOfCamera2": np.eye(3),
    "TranslationOfCamera2": np.array([[-4.0, 0.0, 0.0]]), "Version": PARAMETERS["Version"],
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


def mat_of(variables, **how):
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


def paired(folder: Path) -> bool:
    return baseline(4.0)(folder) and centred(folder)


IN_METRES = PAIR | {"CameraParameters1": PARAMETERS | {"WorldUnits": "m"}, "TranslationOfCamera2": [[-0.004, 0.0, 0.0]]}
SQUARE = {"CameraParameters1": PARAMETERS | {"IntrinsicMatrix": np.diag([1, 100 / 101, 1]) @ K_FROM_1.T},
          "CameraParameters2": PARAMETERS | {"IntrinsicMatrix": np.diag([1, 100 / 101, 1]) @ K_FROM_1.T}}  # fmt: skip
INTRINSICS = {"FocalLength": [[100.0, 101.0]], "PrincipalPoint": [[64.5, 48.5]], "ImageSize": [[96.0, 128.0]],
              "RadialDistortion": [[0.0, 0.0, 0.0]], "Skew": 0.0, "K": K_FROM_1}  # fmt: skip


def missing_calibration(folder: Path) -> list[str]:
    files(folder, "clip", pictures())
    return prepare("clip", "--calibration", str(folder / "scope"), camera=())(folder)


def opencv_matrix(name: str, numbers, cols: int) -> str:
    data = ", ".join(f"{number:g}." if number == int(number) else f"{number}" for number in numbers)
    return f"{name}: !!opencv-matrix\n   rows: 3\n   cols: {cols}\n   dt: d\n   data: [{data}]\n"


PROJECTION = [100, 0, 63.5, 0, 0, 100, 47.5, 0, 0, 0, 1, 0]
RIGHT = [100, 0, 63.5, -400, 0, 100, 47.5, 0, 0, 0, 1, 0]
RECTIFIED = "%YAML:1.0\n---\n" + opencv_matrix("P1", PROJECTION, 4) + opencv_matrix("P2", RIGHT, 4)
RAW_KITTI = "calib_time: 09-Jan-2012 13:57:47\n" + "".join(
    f"S_rect_0{k}: 1.28e+02 9.6e+01\n" + P.format(f"P_rect_0{k}", tx) for k, tx in enumerate((0, -40, 4, -36))
)
SIDES = ("left", "right")


@builder
def lens(folder: Path, *words: str, size=(WIDTH, HEIGHT), camera=CAMERA) -> list[str]:
    """Pictures of this size with a camera, and further words."""
    files(folder, "clip", [picture(i, *size) for i in range(12)])
    return prepare("clip", *words, camera=camera)(folder)


METASHAPE = "<?xml version='1.0'?><calibration><projection>frame</projection><f>100</f></calibration>"
NORMALISED = json.dumps({"K": [[0.78, 0, 0.5], [0, 1.05, 0.5], [0, 0, 1]]})
HALF = "50 0 31.5\n0 50 23.5\n0 0 1\n"
OTHER_ORDER = "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [-0.1, 0.01, {}]\n"


@builder
def calibration_file(folder: Path, name: str, save) -> list[str]:
    """Pictures with a calibration that `save` writes."""
    save(folder / name)
    files(folder, "clip", pictures())
    return prepare("clip", "--calibration", str(folder / name), camera=())(folder)


def arrays(**named):
    return lambda path: np.savez(path, **named)


def plain(**named):
    return lambda path: path.write_text(json.dumps({"fx": 100, "fy": 101, "cx": 63.5, "cy": 47.5} | named))


def undistorted(folder: Path) -> bool:
    """A distortion was applied: the written focal length is another one."""
    return abs(read_sequence_file(folder / "o").camera.fx - 100) > 1


LENS = np.array([[100.0, 0, 63.5], [0, 101, 47.5], [0, 0, 1]])
BENT = np.array([[-0.2, 0.05, 1e-3, -2e-3, 0.01]])
SIZE = {"width": WIDTH, "height": HEIGHT}
CALIBRATION_ROWS = [
    Row("camera in parts of the picture", with_camera("0.78", "1.04", "0.5", "0.5"), "told", "field-of-view"),
    Row("camera in millimetres", with_camera("4.2", "4.2", "64", "48"), "told", "field-of-view"),
    Row("camera of another size", with_camera("1000", "1000", "960", "540"), "refused",
        "is the calibration of another picture size?"),
    Row("camera with a negative focal length", with_camera("-100", "100", "64", "48"), "refused",
        "focal length -100: use numbers > 0"),
    Row("camera with decimal commas", with_camera("100,5", "100,5", "64", "48"), "refused", "100,5"),
    Row("camera, principal point in parts of the picture", with_camera("100", "100", "0.5", "0.5"), "told",
        "principal-point"),
    Row("camera, cx and cy exchanged", lens(size=(160, 128), camera=("--camera", "142", "142", "64", "80")), "told",
        "near the centre with cx and cy exchanged"),
    Row("camera, distortion of another lens", lens("--distortion", "-0.9", "0", "0", "0"), "told",
        "turns back inside the picture"),
    Row("camera, one with a baseline", folder_of(pictures(), "--baseline", "4"), "told", "next: endotsr poses",
        lambda folder: read_sequence_file(folder / "o").camera.baseline == 4),
    Row("camera of half the size", with_camera("50", "50", "32", "24"), "told", "of 0.5 times this size"),
    Row("camera of two thirds of the size", with_camera("67", "67", "42.7", "32"), "told", "of 0.667 times this size"),
    Row("camera of one and a half times the size", with_camera("150", "150", "96", "72"), "told",
        "of 1.5 times this size"),
    Row("camera in the order fx cx fy cy", with_camera("100", "64", "101", "48"), "told", "principal-point"),
    Row("camera, k1 k2 k3 p1 p2", folder_of(pictures(), "--distortion", "-0.1", "0.01", "-0.08", "0.001", "0.002"),
        "told", "if they are k1 k2 k3 p1 p2"),
    Row("calibration, cameraParameters of MATLAB as a struct", mat(mat_of({"cameraParams": PARAMETERS})), "told",
        "half a pixel was added", centred),
    Row("calibration, cameraParameters of MATLAB with -struct, compressed", mat(mat_of(PARAMETERS,
        do_compression=True)), "told", "half a pixel was added", centred),
    Row("calibration, cameraIntrinsics of MATLAB", mat(mat_of({"intrinsics": INTRINSICS})), "told",
        "half a pixel was added", centred),
    Row("calibration, stereoParameters of MATLAB", mat(mat_of({"s": PAIR | SQUARE}), pair=True), "told",
        "rectified: baseline 4 mm", paired),
    Row("calibration, stereoParameters of MATLAB in metres", mat(mat_of(IN_METRES | {k: v | {"WorldUnits": "m"} for k,
        v in SQUARE.items()}), pair=True), "told", "rectified: baseline 4 mm", paired),
    Row("calibration, a field of MATLAB that is not known", mat(mat_of({"c": PARAMETERS | {"LensShading": 1.0}})),
        "told", "unknown here: LensShading", centred),
    Row("calibration, Calib_Results_stereo.mat", mat(mat_of(BOUGUET), pair=True), "told", "rectified: baseline 4 mm",
        paired),
    Row("calibration, matrices in a MAT-file", mat(mat_of({"K": K_FROM_1 - [[0, 0, 1], [0, 0, 1], [0, 0, 0]],
        "D": np.zeros((1, 5))})), "told", "those of MATLAB's classes are 1 larger", centred),
    Row("calibration, a transposed matrix in a MAT-file", mat(mat_of({"K": K_FROM_1.T, "D": np.zeros((1, 5))})),
        "refused", "is the matrix transposed?"),
    Row("calibration, skew in MATLAB", mat(mat_of({"c": PARAMETERS | {"Skew": 0.2}})), "refused", "Skew = 0.2"),
    Row("calibration, fisheyeParameters of MATLAB", mat(mat_of({"c": {"MappingCoefficients": [[800.0, -1e-3, 0, 0]],
        "DistortionCenter": [[64.0, 48.0]], "ImageSize": [[96.0, 128.0]]}})), "refused", "fisheye"),
    Row("calibration, stereoParams itself in a MAT-file", mat(opaque), "refused", "toStruct(OBJECT)"),
    Row("calibration, a MAT-file of version 7.3", mat(of_7_3), "refused", "'-v7'"),
    Row("calibration, a MAT-file of version 4", mat(mat_of({"K": K_FROM_1}, format="4")), "refused", "'-v7'"),
    Row("calibration, two cameras in a MAT-file", mat(mat_of({"left": PARAMETERS, "right": PARAMETERS})), "refused",
        "2 calibrations"),
    Row("calibration, parts of the picture in JSON", calibrated("a.json", NORMALISED), "told", "field-of-view"),
    Row("calibration, npz of OpenCV's tutorial", calibration_file("c.npz", arrays(ret=0.3, mtx=LENS, dist=0 * BENT,
        rvecs=np.zeros((3, 3, 1)), tvecs=np.zeros((3, 3, 1)))), "told", "half a pixel was added", centred),
    Row("calibration, npz with distortion", calibration_file("c.npz", arrays(camera_matrix=LENS, dist_coeffs=BENT)),
        "told", "undistorted: distortion -0.2", undistorted),
    Row("calibration, npy of a matrix", calibration_file("K.npy", lambda path: np.save(path, LENS)), "told",
        "half a pixel was added", centred),
    Row("calibration, npz with two matrices", calibration_file("c.npz", arrays(K=LENS, mtx=2 * LENS)), "refused",
        "K and mtx differ; use one of them"),
    Row("calibration, npz with the name of a fisheye model", calibration_file("c.npz", arrays(K=LENS,
        model=np.array("fisheye"))), "refused", "another camera model is not supported"),
    Row("calibration, npz with other names", calibration_file("c.npz", arrays(a=LENS)), "refused", "it holds a; use"),
    Row("calibration, pickle", calibration_file("c.pkl", lambda path: path.write_bytes(pickle.dumps((LENS, BENT)))),
        "refused", "numpy.savez(f + '.npz', mtx=..., dist=...)"),
    Row("calibration, JSON with K and D of two tools", calibration_file("c.json",
        lambda path: path.write_text(json.dumps({"camera_matrix": LENS.tolist(), "D": BENT.tolist()}))), "told",
        "undistorted: distortion -0.2", undistorted),
    Row("calibration, flat JSON", calibration_file("c.json", plain(**SIZE)), "told", "half a pixel was added", centred),
    Row("calibration, flat JSON with distortion", calibration_file("c.json", plain(k1=-0.2, k2=0.05)), "told",
        "undistorted: distortion -0.2, 0.05", undistorted),
    Row("calibration, flat JSON of another size", calibration_file("c.json", plain(width=96, height=96)), "refused",
        "the calibration is of 96x96"),
    Row("calibration, flat JSON of twice the size", calibration_file("c.json", plain(w=2 * WIDTH, h=2.0 * HEIGHT)),
        "told", "scaled to the 128x96", lambda folder: read_sequence_file(folder / "o").camera.fx == 50),
    Row("calibration, flat JSON, a size in words", calibration_file("c.json", plain(width="128", height=96)), "refused",
        "width: '128' is not allowed"),
    Row("calibration, flat JSON of a RealSense", calibration_file("c.json",
        lambda path: path.write_text(json.dumps({"fx": 100, "fy": 101, "ppx": 64, "ppy": 48}))), "refused",
        "cx, cy missing; use fx, fy, cx, cy"),
    Row("calibration, flat JSON, fisheye", calibration_file("c.json", plain(k1=0.1, k2=0.1, k3=0.1, k4=0.1)), "refused",
        "k4 without p1 and p2"),
    Row("calibration, ROS", calibrated("a.yaml", ros_text()), "told", "half a pixel was added", centred),
    Row("calibration, ROS, fisheye", calibrated("a.yaml", ros_text(distortion_model="equidistant")), "refused",
        "use plumb_bob or rational_polynomial"),
    Row("calibration, Kalibr", calibrated("a.yaml", kalibr_text()), "told", "half a pixel was added", centred),
    Row("calibration, Kalibr, of another size", calibrated("a.yaml", kalibr_text(resolution=[128, 128])), "refused",
        "the calibration is of 128x128"),
    Row("calibration, matrix K as text", calibrated("K.txt", MATRIX), "told", "half a pixel was added", centred),
    Row("calibration, OpenCV YAML", calibrated("a.yaml", OPENCV), "told", "half a pixel was added", centred),
    Row("calibration, a hostile tag in YAML", calibrated("a.yaml", "K: !!python/object/apply:os.getcwd []"), "refused",
        "not YAML"),
    Row("calibration, rostopic echo with roi and several messages", calibrated("a.yaml",
        ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2)), "told", "half a pixel", centred),
    Row("calibration, rostopic echo of two cameras", calibrated("a.yaml",
        ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2).replace("101.0", "103.0")), "refused",
        "2 documents that differ"),
    Row("calibration, rostopic echo, fisheye", calibrated("a.yaml", ROS_ECHO.format(seq=1).replace("plumb_bob",
        "equidistant")), "refused", "distortion_model 'equidistant'"),
    Row("calibration, with --distortion", calibrated("K.txt", MATRIX, "--distortion", "0.1", "0", "0", "0"), "refused",
        "a calibration file states intrinsics and distortion"),
    Row("calibration, K and D with 4 coefficients", calibrated("a.yaml", FISHEYE), "told", "read as k1 k2 p1 p2"),
    Row("calibration, settings of ORB-SLAM", calibrated("a.yaml", ORB.format("PinHole", 0.0)), "told", "half a pixel",
        centred),
    Row("calibration, fisheye settings of ORB-SLAM", calibrated("a.yaml", ORB.format("KannalaBrandt8", 0.1)), "refused",
        "use PinHole or Rectified"),
    Row("calibration, sensor.yaml of EuRoC", calibrated("a.yaml", EUROC), "told", "half a pixel", centred),
    Row("calibration, calib.txt of KITTI", calibrated("calib.txt", kitti_pair(), folders=("left", "right")), "told",
        "P0 and P1 are read", baseline(4.0)),
    Row("calibration, cells within one another", mat(deep), "refused", "use at most 16 levels"),
    Row("calibration, calib.txt of KITTI, P2 and P3 alone", calibrated("calib.txt", P.format("P2", 4) + P.format("P3",
        -36), folders=SIDES), "told", "P2 and P3 are read", baseline(400)),
    Row("calibration, calib.txt of KITTI, one camera", calibrated("calib.txt", P.format("P2", 4)), "told",
        "P2 is read as one camera, without a baseline", centred),
    Row("calibration, calib_cam_to_cam.txt of KITTI", calibrated("calib_cam_to_cam.txt", RAW_KITTI, folders=SIDES),
        "told", "P_rect", baseline(400)),
    Row("calibration, P1 and P2 of OpenCV", calibrated("a.yaml", RECTIFIED, folders=SIDES), "told", "P2", baseline(4)),
    Row("calibration, a projection with a baseline as text", calibrated("K.txt",
        "100 0 63.5 -40\n0 101 47.5 0\n0 0 1 0\n"), "refused", "fourth column"),
    Row("calibration, matrix with decimal commas", calibrated("K.txt", MATRIX.replace(".", ",")), "refused",
        "write decimal points"),
    Row("calibration, P1 and P2 of unlike cameras", calibrated("a.yaml", RECTIFIED.replace("63.5, -400", "93.5, -400"),
        folders=SIDES), "refused", "CALIB_ZERO_DISPARITY"),
    Row("calibration, P1 and P2 of a pair above one another", calibrated("a.yaml",
        RECTIFIED.replace("-400., 0., 100., 47.5, 0.", "0., 0., 100., 47.5, -400."), folders=SIDES), "refused",
        "above or below it"),
    Row("calibration, ROS, the right camera alone", calibrated("a.yaml", ros_text(projection_matrix={"rows": 3,
        "cols": 4, "data": [float(value) for value in RIGHT]})), "told", "a right camera"),
    Row("calibration that is not there", missing_calibration, "refused", "scope: not found"),
    Row("calibration, YAML with tabs", calibrated("a.yaml", "camera_matrix:\n\tdata: [1]\n"), "refused",
        "cannot start any token (line 2)"),
    Row("calibration, matrix K as csv", calibrated("K.csv", MATRIX.replace(" ", ",")), "told", "half a pixel was added",
        centred),
    Row("calibration, matrix K of half the size", calibrated("K.txt", HALF), "told", "of 0.5 times this size"),
    Row("calibration of Metashape", calibrated("a.xml", METASHAPE), "refused", "the root is calibration"),
    Row("calibration, CSV with semicolons", calibrated("K.csv", "100;0;63.5\n0;101;47.5\n0;0;1\n"), "told",
        "half a pixel", centred),
    Row("calibration, k1 k2 k3 p1 p2", calibrated("a.yaml", OPENCV + OTHER_ORDER.format("-0.08, 0.0007, -0.0003")),
        "told", "if they are k1 k2 k3 p1 p2"),
]  # fmt: skip
