"""Rows of `inputs_tried.py` about cameras and calibrations: numbers of a command line and files of other programs."""

import json
import pickle
import struct
from pathlib import Path

import numpy as np
from calibration_files import kalibr, ros
from input_kinds import MATRIX, P, calibrated, folder_of, twelve
from input_rows import baseline, both, centred, refused, told
from made_videos import HEIGHT, WIDTH, picture
from public_layouts import K
from scipy.io import savemat

from endotsr.clips.sequences.sequence_file import read_sequence_file


def with_camera(*numbers: float):
    return twelve(camera=("--camera", *map(str, numbers)))


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
ORB = "%YAML:1.0\nCamera.type: {}\nCamera.fx: 100.0\nCamera.fy: 101.0\nCamera.cx: 63.5\nCamera.cy: 47.5\nCamera.k1: {}"
EUROC = "sensor_type: camera\nresolution: [128, 96]\ncamera_model: pinhole\nintrinsics: [100, 101, 63.5, 47.5]\n"
FISHEYE = "K: {data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]}\nD: {data: [0.01, 0., 0., 0.]}\n"
K_FROM_1 = K + [[0, 0, 1], [0, 0, 1], [0, 0, 0]]  # the first pixel has its centre at 1
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


OF_7_3 = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512) + b"\x89HDF\r\n\x1a\n" + b"\0" * 99


def mat(variables, pair: bool = False, **how):
    """Pictures, or pairs of pictures, with a calibration in a MAT-file of these variables, or as `put` writes it."""
    what = (lambda path: savemat(path, variables, **how)) if isinstance(variables, dict) else variables
    return calibrated("calibration.mat", what, folders=SIDES if pair else (".",))


paired = both(baseline(4.0), centred)
SQUARE = {
    f"CameraParameters{k}": PARAMETERS | {"IntrinsicMatrix": np.diag([1, 100 / 101, 1]) @ K_FROM_1.T} for k in "12"
}
IN_METRES = PAIR | {k: v | {"WorldUnits": "m"} for k, v in SQUARE.items()} | {"TranslationOfCamera2": [[-0.004, 0, 0]]}
INTRINSICS = {"FocalLength": [[100.0, 101.0]], "PrincipalPoint": [[64.5, 48.5]], "ImageSize": [[96.0, 128.0]],
              "RadialDistortion": [[0.0, 0.0, 0.0]], "Skew": 0.0, "K": K_FROM_1}  # fmt: skip


def opencv_matrix(name: str, numbers) -> str:
    data = ", ".join(f"{float(number):g}" + "." * int(number == int(number)) for number in numbers)
    return f"{name}: !!opencv-matrix\n   rows: 3\n   cols: {len(numbers) // 3}\n   dt: d\n   data: [{data}]\n"


OPENCV = "%YAML:1.0\n---\n" + opencv_matrix("camera_matrix", K.ravel())
LEFT, RIGHT = ([100, 0, 63.5, x, 0, 100, 47.5, 0, 0, 0, 1, 0] for x in (0, -400))
RECTIFIED = "%YAML:1.0\n---\n" + opencv_matrix("P1", LEFT) + opencv_matrix("P2", RIGHT)
RAW_KITTI = "calib_time: 09-Jan-2012 13:57:47\n" + "".join(
    f"S_rect_0{k}: 1.28e+02 9.6e+01\n" + P.format(f"P_rect_0{k}", tx) for k, tx in enumerate((0, -40, 4, -36))
)
SIDES = ("left", "right")
METASHAPE = "<?xml version='1.0'?><calibration><projection>frame</projection><f>100</f></calibration>"
NORMALISED = json.dumps({"K": [[0.78, 0, 0.5], [0, 1.05, 0.5], [0, 0, 1]]})
HALF = "50 0 31.5\n0 50 23.5\n0 0 1\n"
OTHER_ORDER = "distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [-0.1, 0.01, {}]\n"


def arrays(**named):
    return lambda path: np.savez(path, **named)


def plain(**named) -> str:
    return json.dumps({"fx": 100, "fy": 101, "cx": 63.5, "cy": 47.5} | named)


def undistorted(folder: Path) -> bool:
    """A distortion was applied: the written focal length is another one."""
    return abs(read_sequence_file(folder / "o").camera.fx - 100) > 1


BENT = np.array([[-0.2, 0.05, 1e-3, -2e-3, 0.01]])


def shifted(kind: str, make):
    """A calibration in the convention of OpenCV."""
    return told(kind, make, "half a pixel was added", centred)


CALIBRATION_ROWS = [
    told("camera in parts of the picture", with_camera(0.78, 1.04, 0.5, 0.5), "field-of-view"),
    refused("camera of another size", with_camera(1000, 1000, 960, 540),
        "is the calibration of another picture size?"),
    refused("camera with a negative focal length", with_camera(-100, 100, 64, 48),
        "focal length -100: use numbers > 0"),
    told("camera, principal point in parts of the picture", with_camera(100, 100, 0.5, 0.5), "principal-point"),
    told("camera, cx and cy exchanged", folder_of([picture(i, 160, 128) for i in range(12)], camera=("--camera", "142",
        "142", "64", "80")), "near the centre with cx and cy exchanged"),
    told("camera, distortion of another lens", twelve("--distortion", "-0.9", "0", "0", "0"),
        "turns back inside the picture"),
    told("camera, one with a baseline", twelve("--baseline", "4"), "next: endotsr poses",
        lambda folder: read_sequence_file(folder / "o").camera.baseline == 4),
    told("camera of half the size", with_camera(50, 50, 32, 24), "of 0.5 times this size"),
    told("camera, k1 k2 k3 p1 p2", twelve("--distortion", "-0.1", "0.01", "-0.08", "0.001", "0.002"),
        "if they are k1 k2 k3 p1 p2"),
    shifted("calibration, cameraParameters of MATLAB as a struct", mat({"cameraParams": PARAMETERS})),
    shifted("calibration, cameraParameters of MATLAB with -struct, compressed", mat(PARAMETERS, do_compression=True)),
    shifted("calibration, cameraIntrinsics of MATLAB", mat({"intrinsics": INTRINSICS})),
    told("calibration, stereoParameters of MATLAB", mat({"s": PAIR | SQUARE}, pair=True), "rectified: baseline 4 mm",
        paired),
    told("calibration, stereoParameters of MATLAB in metres", mat(IN_METRES, pair=True), "rectified: baseline 4 mm",
        paired),
    told("calibration, a field of MATLAB that is not known", mat({"c": PARAMETERS | {"LensShading": 1.0}}),
        "unknown here: LensShading", centred),
    told("calibration, Calib_Results_stereo.mat", mat(BOUGUET, pair=True), "rectified: baseline 4 mm", paired),
    told("calibration, matrices in a MAT-file", mat({"K": K, "D": np.zeros((1, 5))}),
        "those of MATLAB's classes are 1 larger", centred),
    refused("calibration, a transposed matrix in a MAT-file", mat({"K": K_FROM_1.T, "D": np.zeros((1, 5))}),
        "is the matrix transposed?"),
    refused("calibration, skew in MATLAB", mat({"c": PARAMETERS | {"Skew": 0.2}}), "Skew = 0.2"),
    refused("calibration, fisheyeParameters of MATLAB", mat({"c": {"MappingCoefficients": [[800.0, -1e-3, 0, 0]],
        "DistortionCenter": [[64.0, 48.0]], "ImageSize": [[96.0, 128.0]]}}), "fisheye"),
    refused("calibration, stereoParams itself in a MAT-file", mat(opaque), "toStruct(OBJECT)"),
    refused("calibration, a MAT-file of version 7.3", mat(OF_7_3), "'-v7'"),
    refused("calibration, two cameras in a MAT-file", mat({"left": PARAMETERS, "right": PARAMETERS}),
        "2 calibrations"),
    told("calibration, parts of the picture in JSON", calibrated("a.json", NORMALISED), "field-of-view"),
    shifted("calibration, npz of OpenCV's tutorial", calibrated("c.npz", arrays(ret=0.3, mtx=K, dist=0 * BENT,
        rvecs=np.zeros((3, 3, 1)), tvecs=np.zeros((3, 3, 1))))),
    told("calibration, npz with distortion", calibrated("c.npz", arrays(camera_matrix=K, dist_coeffs=BENT)),
        "undistorted: distortion -0.2", undistorted),
    shifted("calibration, npy of a matrix", calibrated("K.npy", lambda path: np.save(path, K))),
    refused("calibration, npz with two matrices", calibrated("c.npz", arrays(K=K, mtx=2 * K)),
        "K and mtx differ; use one of them"),
    refused("calibration, npz with the name of a fisheye model", calibrated("c.npz", arrays(K=K,
        model=np.array("fisheye"))), "another camera model is not supported"),
    refused("calibration, npz with other names", calibrated("c.npz", arrays(a=K)), "it holds a; use"),
    refused("calibration, pickle", calibrated("c.pkl", pickle.dumps((K, BENT))),
        "numpy.savez(f + '.npz', mtx=..., dist=...)"),
    told("calibration, JSON with K and D of two tools", calibrated("c.json", json.dumps({"camera_matrix": K.tolist(),
        "D": BENT.tolist()})), "undistorted: distortion -0.2", undistorted),
    shifted("calibration, flat JSON", calibrated("c.json", plain(width=WIDTH, height=HEIGHT))),
    told("calibration, flat JSON with distortion", calibrated("c.json", plain(k1=-0.2, k2=0.05)),
        "undistorted: distortion -0.2, 0.05", undistorted),
    refused("calibration, flat JSON of another size", calibrated("c.json", plain(width=96, height=96)),
        "the calibration is of 96x96"),
    told("calibration, flat JSON of twice the size", calibrated("c.json", plain(w=2 * WIDTH, h=2.0 * HEIGHT)),
        "scaled to the 128x96", lambda folder: read_sequence_file(folder / "o").camera.fx == 50),
    refused("calibration, flat JSON, a size in words", calibrated("c.json", plain(width="128", height=96)),
        "width: '128' is not allowed"),
    refused("calibration, flat JSON of a RealSense", calibrated("c.json", json.dumps({"fx": 100, "fy": 101, "ppx": 64,
        "ppy": 48})), "cx, cy missing; use fx, fy, cx, cy"),
    refused("calibration, flat JSON, fisheye", calibrated("c.json", plain(k1=0.1, k2=0.1, k3=0.1, k4=0.1)),
        "k4 without p1 and p2"),
    shifted("calibration, ROS", calibrated("a.yaml", ros(K, [0.0] * 5))),
    shifted("calibration, Kalibr", calibrated("a.yaml", kalibr(pair=False, distortion_coeffs=[0.0] * 4))),
    refused("calibration, Kalibr, of another size", calibrated("a.yaml", kalibr(pair=False, resolution=[128, 128])),
        "the calibration is of 128x128"),
    shifted("calibration, matrix K as text", calibrated("K.txt", MATRIX)),
    shifted("calibration, OpenCV YAML", calibrated("a.yaml", OPENCV)),
    refused("calibration, a hostile tag in YAML", calibrated("a.yaml", "K: !!python/object/apply:os.getcwd []"),
        "not YAML"),
    shifted("calibration, rostopic echo with roi and several messages", calibrated("a.yaml",
        ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2))),
    refused("calibration, rostopic echo of two cameras", calibrated("a.yaml",
        ROS_ECHO.format(seq=1) + ROS_ECHO.format(seq=2).replace("101.0", "103.0")), "2 documents that differ"),
    refused("calibration, rostopic echo, fisheye", calibrated("a.yaml", ROS_ECHO.format(seq=1).replace("plumb_bob",
        "equidistant")), "distortion_model 'equidistant'"),
    refused("calibration, with --distortion", calibrated("K.txt", MATRIX, "--distortion", "0.1", "0", "0", "0"),
        "a calibration file states intrinsics and distortion"),
    told("calibration, K and D with 4 coefficients", calibrated("a.yaml", FISHEYE), "read as k1 k2 p1 p2"),
    shifted("calibration, settings of ORB-SLAM", calibrated("a.yaml", ORB.format("PinHole", 0.0))),
    refused("calibration, fisheye settings of ORB-SLAM", calibrated("a.yaml", ORB.format("KannalaBrandt8", 0.1)),
        "use PinHole or Rectified"),
    shifted("calibration, sensor.yaml of EuRoC", calibrated("a.yaml", EUROC)),
    told("calibration, calib.txt of KITTI", calibrated("calib.txt", P.format("P0", 0) + P.format("P1", -0.4),
        folders=SIDES), "P0 and P1 are read", baseline(4.0)),
    refused("calibration, cells within one another", mat(deep), "use at most 16 levels"),
    told("calibration, calib.txt of KITTI, P2 and P3 alone", calibrated("calib.txt", P.format("P2", 4) + P.format("P3",
        -36), folders=SIDES), "P2 and P3 are read", baseline(400)),
    told("calibration, calib.txt of KITTI, one camera", calibrated("calib.txt", P.format("P2", 4)),
        "P2 is read as one camera, without a baseline", centred),
    told("calibration, calib_cam_to_cam.txt of KITTI", calibrated("calib_cam_to_cam.txt", RAW_KITTI, folders=SIDES),
        "P_rect", baseline(400)),
    told("calibration, P1 and P2 of OpenCV", calibrated("a.yaml", RECTIFIED, folders=SIDES), "P2", baseline(4)),
    refused("calibration, a projection with a baseline as text", calibrated("K.txt",
        "100 0 63.5 -40\n0 101 47.5 0\n0 0 1 0\n"), "fourth column"),
    refused("calibration, matrix with decimal commas", calibrated("K.txt", MATRIX.replace(".", ",")),
        "write decimal points"),
    refused("calibration, P1 and P2 of unlike cameras", calibrated("a.yaml", RECTIFIED.replace("63.5, -400",
        "93.5, -400"), folders=SIDES), "CALIB_ZERO_DISPARITY"),
    refused("calibration, P1 and P2 of a pair above one another", calibrated("a.yaml",
        RECTIFIED.replace("-400., 0., 100., 47.5, 0.", "0., 0., 100., 47.5, -400."), folders=SIDES),
        "above or below it"),
    told("calibration, ROS, the right camera alone", calibrated("a.yaml", ros(K, [0.0] * 5,
        projection_matrix={"rows": 3, "cols": 4, "data": [float(value) for value in RIGHT]})), "a right camera"),
    refused("calibration that is not there", calibrated("scope", lambda path: None), "scope: not found"),
    shifted("calibration, matrix K as csv", calibrated("K.csv", MATRIX.replace(" ", ","))),
    told("calibration, matrix K of half the size", calibrated("K.txt", HALF), "of 0.5 times this size"),
    refused("calibration of Metashape", calibrated("a.xml", METASHAPE), "the root is calibration"),
    shifted("calibration, CSV with semicolons", calibrated("K.csv", "100;0;63.5\n0;101;47.5\n0;0;1\n")),
    told("calibration, k1 k2 k3 p1 p2", calibrated("a.yaml", OPENCV + OTHER_ORDER.format("-0.08, 0.0007, -0.0003")),
        "if they are k1 k2 k3 p1 p2"),
]  # fmt: skip
