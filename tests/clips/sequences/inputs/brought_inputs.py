"""Rows of `inputs_tried.py` about files as other programs export them, and words of a command line as people copy them.

Trajectories of ROS, spreadsheets and photogrammetry, masks of networks in other containers, pictures in hidden files.
"""

import json
import pickle
from pathlib import Path

import numpy as np
from builders import builder
from depth_folders import true_depth
from input_kinds import (
    Row,
    centred,
    depth,
    depth_files,
    depth_is_true,
    folder_of,
    half_excluded,
    mask,
    masked,
    named,
    prepare,
    rewritten,
    size,
    trajectory,
)
from made_videos import HEIGHT, WIDTH, files, picture, pictures
from PIL import Image
from scipy.io import savemat

from endotsr.clips.formats.conversions import LOADS as LINES
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file

POSES = [(0.04 * i, 0.001 * i, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) for i in range(12)]  # the camera moves 1 mm a frame
ROS = [
    "%time,field.header.seq,field.header.frame_id,"
    + ",".join(f"field.pose.pose.position.{axis}" for axis in "xyz")
    + ","
    + ",".join(f"field.pose.pose.orientation.{axis}" for axis in "xyzw"),
    *(
        ",".join([str(int(1e9 * (1.7e9 + pose[0]))), str(i), "map", *(f"{value:.6f}" for value in pose[1:])])
        for i, pose in enumerate(POSES)
    ),
]
ROTATED = [f"{i:04d}.png,{0.001 * i},0,0,0.1,0.2,0.3" for i in range(12)]


def lines(separator: str = " ", factor: float = 1.0, sign: int = 1, end: str = "", quote: str = "") -> list[str]:
    """The poses as text, positions times a factor; every second quaternion with this sign."""
    found = []
    for i, (stamp, *rest) in enumerate(POSES):
        turn = [sign**i * value for value in rest[3:]]
        row = [stamp, *(factor * value for value in rest[:3]), *turn]
        found.append(separator.join(f"{quote}{value:.6f}{quote}" for value in row) + end)
    return found


def moved(folder: Path) -> bool:
    """The written camera moves by 1 mm from frame to frame."""
    poses = read_sequence_file(folder / "o").poses
    return poses is not None and np.allclose(
        [np.linalg.norm(np.reshape(matrix, (-1, 4))[:3, 3]) for matrix in poses.matrices], np.arange(12), atol=1e-3
    )


@builder
def trajectory_file(folder: Path, name: str, content: bytes = b"PK\3\4") -> list[str]:
    """Pictures with a trajectory in a file of another kind."""
    (folder / name).write_bytes(content)
    return folder_of(pictures(), "--trajectory", str(folder / name))(folder)


@builder
def mask_files(folder: Path, save, ending: str) -> list[str]:
    """Masks that `save` writes; it gets the path and the plane."""
    (folder / "m").mkdir()
    for i in range(12):
        save(folder / "m" / f"{i:04d}{ending}", mask())
    return [*folder_of(pictures())(folder), "--masks", str(folder / "m")]


@builder
def depth_file(folder: Path, name: str, save) -> list[str]:
    """All depth in one file."""
    save(folder / name)
    return [*folder_of(pictures())(folder), "--depth", str(folder / name)]


@builder
def mask_file(folder: Path, name: str, save) -> list[str]:
    """All masks in one file."""
    save(folder / name)
    return [*folder_of(pictures())(folder), "--masks", str(folder / name)]


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


def by_object(folder: Path) -> list[str]:
    for name in "12":
        files(folder / "m", name, [mask()] * 12)
    return [*folder_of(pictures())(folder), "--masks", str(folder / "m")]


def saved_by(mode: str, **how):
    """Masks in another mode of Pillow."""
    return lambda folder: rewritten(folder, lambda opened: opened.convert(mode), **how)


def one_changed(change, number: int = 5):
    """Frame 5 as another picture."""

    def done(folder: Path) -> None:
        file = folder / f"clip/{number:04d}.png"
        write_png(file, change(read_png(file)))

    return folder_of([picture(0.5 * i) for i in range(12)], change=done)


def green(shown: np.ndarray) -> np.ndarray:
    """The lower half as a decoder paints what it lost."""
    shown = shown.copy()
    shown[HEIGHT // 2 :] = (0, 135, 0)
    return shown


def far_values(plane: np.ndarray) -> np.ndarray:
    """Depth of a renderer: nothing is at infinity, and a lost pixel is not a number."""
    plane = plane.astype(np.float32)
    plane[:4], plane[:, :4] = np.inf, np.nan
    return plane


def depth_is_true_inside(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    found = read_png(folder / "o/depth/000002.png") * (entry.scale if entry else 0)
    return bool(np.abs(found - true_depth(2))[4:, 4:].max() < 0.03 and not found[:4].any() and not found[:, :4].any())


MATRIX = np.array([[100.0, 0, 63.5], [0, 101, 47.5], [0, 0, 1]])
BENT = np.array([[-0.2, 0.05, 1e-3, -2e-3, 0.01]])
LOADS = {ending: load for ending, (_, load) in LINES.items()}
SIZE = {"width": WIDTH, "height": HEIGHT}
BROUGHT_ROWS = [
    Row("calibration, npz of OpenCV's tutorial", calibration_file("c.npz", arrays(ret=0.3, mtx=MATRIX, dist=0 * BENT,
        rvecs=np.zeros((3, 3, 1)), tvecs=np.zeros((3, 3, 1)))), "told", "half a pixel was added", centred),
    Row("calibration, npz with distortion", calibration_file("c.npz", arrays(camera_matrix=MATRIX, dist_coeffs=BENT)),
        "told", "undistorted: distortion -0.2", undistorted),
    Row("calibration, npy of a matrix", calibration_file("K.npy", lambda path: np.save(path, MATRIX)), "told",
        "half a pixel was added", centred),
    Row("calibration, npz with two matrices", calibration_file("c.npz", arrays(K=MATRIX, mtx=2 * MATRIX)), "refused",
        "K and mtx differ; use one of them"),
    Row("calibration, npz with the name of a fisheye model", calibration_file("c.npz", arrays(K=MATRIX,
        model=np.array("fisheye"))), "refused", "another camera model is not supported"),
    Row("calibration, npz with other names", calibration_file("c.npz", arrays(a=MATRIX)), "refused",
        "it holds a; use"),
    Row("calibration, pickle", calibration_file("c.pkl", lambda path: path.write_bytes(pickle.dumps((MATRIX, BENT)))),
        "refused", "numpy.savez(f + '.npz', mtx=..., dist=...)"),
    Row("calibration, JSON with K and D of two tools", calibration_file("c.json", lambda path: path.write_text(
        json.dumps({"camera_matrix": MATRIX.tolist(), "D": BENT.tolist()}))), "told", "undistorted: distortion -0.2",
        undistorted),
    Row("calibration, flat JSON", calibration_file("c.json", plain(**SIZE)), "told", "half a pixel was added", centred),
    Row("calibration, flat JSON with distortion", calibration_file("c.json", plain(k1=-0.2, k2=0.05)), "told",
        "undistorted: distortion -0.2, 0.05", undistorted),
    Row("calibration, flat JSON of another size", calibration_file("c.json", plain(width=96, height=96)), "refused",
        "the calibration is of 96x96"),
    Row("calibration, flat JSON of twice the size", calibration_file("c.json", plain(w=2 * WIDTH, h=2.0 * HEIGHT)),
        "told", "scaled to the 128x96", lambda folder: read_sequence_file(folder / "o").camera.fx == 50),
    Row("calibration, flat JSON, a size in words", calibration_file("c.json", plain(width="128", height=96)), "refused",
        "width: '128' is not allowed"),
    Row("calibration, flat JSON of a RealSense", calibration_file("c.json", lambda path: path.write_text(json.dumps(
        {"fx": 100, "fy": 101, "ppx": 64, "ppy": 48}))), "refused", "cx, cy missing; use fx, fy, cx, cy"),
    Row("calibration, flat JSON, fisheye", calibration_file("c.json", plain(k1=0.1, k2=0.1, k3=0.1, k4=0.1)), "refused",
        "k4 without p1 and p2"),
    *(Row(f"masks, {ending[1:]} of each frame", mask_files(lambda path, plane: path.write_bytes(b"x"), ending),
        "refused", load) for ending, load in LOADS.items()),
    *(Row(f"masks, one {ending[1:]} of all frames", mask_file(f"m{ending}", lambda path: path.write_bytes(b"x")),
        "refused", load) for ending, load in LOADS.items()),
    Row("depth, pt of each frame", depth_files(lambda path, plane: path.write_bytes(b"x"), ".pt"), "refused",
        'torch.load(f, "cpu", weights_only=True)'),
    Row("depth, mat of all frames", depth_file("d.mat", lambda path: savemat(path, {"z": np.ones((96, 128, 6))})),
        "refused", '["z"], 2, 0))` if its last axis is that of the frames'),
    Row("trajectory, rostopic echo -p", trajectory(ROS), "told", "by the head line", moved),
    Row("trajectory, cells in quotation marks", trajectory(lines(",", quote='"')), "told", "x y z w", moved),
    Row("trajectory, a comment behind each line", trajectory(lines("\t", end="  # tracked")), "told", "x y z w", moved),
    Row("trajectory, quaternions of either sign", trajectory(lines(sign=-1)), "told", "x y z w", moved),
    Row("trajectory of a spreadsheet, names with spaces", trajectory(["Time;Position X [m];Position Y [m];"
        "Position Z [m];Quat X;Quat Y;Quat Z;Quat W", *lines(";")]), "told", "by the head line", moved),
    Row("trajectory in millimetres by the head line", trajectory(["stamp,tx [mm],ty [mm],tz [mm],qx,qy,qz,qw",
        *lines(",", 1e3)]), "refused", "states positions in mm, and they are read in m; use --trajectory-unit mm"),
    Row("trajectory in millimetres by the head line, without brackets", trajectory(["stamp tx_mm ty_mm tz_mm qx qy qz"
        " qw", *lines(factor=1e3)]), "refused", "use --trajectory-unit mm"),
    Row("trajectory in millimetres by the head line, the remedy", trajectory(["# stamp tx_mm ty_mm tz_mm qx qy qz qw",
        *lines(factor=1e3)], "--trajectory-unit", "mm"), "told", "positions in mm", moved),
    Row("trajectory, one pose for all frames", trajectory([f"{i} 0 0 0 0 0 0 1" for i in range(12)]), "told",
        "all 12 poses are the same: the camera is read as one that stands still"),
    Row("trajectory, times of a calendar", trajectory([f"2026-11-30T12:00:{i:02d}Z 0 0 0 0 0 0 1" for i in
        range(12)]), "refused", "'2026-11-30T12:00:00Z' is no number"),
    Row("trajectory, names of pictures", trajectory([f"{i:04d}.png 0 0 0 0 0 0 1" for i in range(12)]), "refused",
        "'0000.png' is no number"),
    Row("trajectory of photogrammetry, angles", trajectory(["#name,x,y,alt,heading,pitch,roll", *ROTATED]), "refused",
        "'0000.png' is no number"),
    *(Row(f"trajectory, {name}", trajectory_file(name), "refused", said) for name, said in (
        ("t.json", "JSON is not read here"), ("t.xlsx", "save its sheet as CSV"), ("t.npz", "numpy.save"),
        ("t.bag", "rostopic echo -p"))),
    Row("masks, logits of a network", mask_files(lambda path, plane: np.save(path, plane / 12.75 - 10.0), ".npy"),
        "refused", 'numpy.save("0000.npy", array > 0)'),
    Row("masks, annotations of COCO", mask_file("m.json", lambda path: path.write_text(json.dumps({"images": []}))),
        "refused", "use a file that ends in one of .png"),
    Row("masks, one folder per object", by_object, "refused", "it holds the folders 1, 2: give one of them"),
    Row("masks, one JSON per frame", mask_files(lambda path, plane: path.write_text("{}"), ".json"), "refused",
        "it holds 12 files of the ending .json"),
    Row("masks, GIF", mask_files(lambda path, plane: Image.fromarray(plane).save(path), ".gif"), "refused",
        "it holds 12 files of the ending .gif"),
    Row("masks, pictures and masks in one npz", mask_files(lambda path, plane: np.savez(path, imgs=np.zeros(
        (HEIGHT, WIDTH, 3)), gts=plane // 255), ".npz"), "right", "", half_excluded),
    Row("masks, two objects in an array", mask_file("m.npy", lambda path: np.save(path, np.zeros((12, 2, HEIGHT, WIDTH),
        bool))), "refused", "(12, 2, 96, 128); use one array"),
    Row("masks, one bit a pixel", masked([mask()] * 12, change=saved_by("1")), "right", "", half_excluded),
    Row("masks, grey and a full alpha channel", masked([mask()] * 12, change=saved_by("LA")), "right", "",
        half_excluded),
    Row("masks of twice the size", masked([np.kron(mask(), np.ones((2, 2), np.uint8))] * 12), "right", "",
        half_excluded),
    Row("masks, an unsure border", masked([np.where(np.roll(mask(), 6, 1) != mask(), 128, mask()).astype(
        np.uint8)] * 12), "refused", "this is not a mask"),
    Row("depth, batch and channel axes", depth_files(lambda path, plane: np.save(path, plane[None, None]), ".npy"),
        "right", "", depth_is_true),
    Row("depth, infinite background and lost pixels", depth_files(lambda path, plane: np.save(path, far_values(plane)),
        ".npy"), "right", "", depth_is_true_inside),
    Row("depth, disparity, depth and confidence in one npz", depth_files(lambda path, plane: np.savez(path, disp=plane,
        depth=plane, conf=plane), ".npz"), "refused", "holds disp (96, 128), depth (96, 128), conf (96, 128)"),
    Row("depth, padded to a square", depth(lambda i: np.pad(true_depth(i), ((16, 16), (0, 0)))), "refused",
        "depth of 128x128 pixels"),
    Row("depth, BMP", depth_files(lambda path, plane: Image.fromarray(plane.astype(np.uint8)).save(path), ".bmp"),
        "refused", "it holds 6 files of the ending .bmp"),
    Row("pictures whose names begin with a dot", named(lambda k: f".{k:04d}.png"), "refused",
        "12 files whose name begins with a dot"),
    Row("names that are long", named(lambda k: "a" * 230 + f"{k:04d}.png"), "refused", "at most 200 bytes"),
    Row("names with the number of frames", named(lambda k: f"f_{k + 1}of12.png"), "right", "", size(WIDTH, HEIGHT)),
    Row("pictures, one half of a frame lost", one_changed(green), "told", "has exactly the colour 0 135 0"),
    Row("pictures, a blue screen between", one_changed(lambda shown: np.full_like(shown, (0, 0, 255))), "told",
        "does not resemble"),
    Row("pictures, one of them grey", one_changed(lambda shown: shown[..., 0]), "refused", "grey picture"),
    Row("an address", lambda folder: ["prepare", "https://example.org/a.mp4", "--out", str(folder / "o")], "refused",
        "is an address; download the file"),
    Row("a pattern of names", lambda folder: [*folder_of(pictures())(folder)[:1], str(folder / "clip/%04d.png"),
        *prepare("clip")(folder)[2:]], "refused", "give the folder of the pictures"),
    Row("a device in place of a file", lambda folder: ["prepare", "/dev/null", "--out", str(folder / "o")], "refused",
        "is neither a file nor a folder"),
    Row("an option behind the dash of a text program", folder_of(pictures(), "\N{EM DASH}scale", "0.5"), "refused",
        "did you mean --scale?"),
    Row("a rate as a fraction", folder_of(pictures(), "--source-rate", "30000/1001"), "refused", "use a number"),
]  # fmt: skip
