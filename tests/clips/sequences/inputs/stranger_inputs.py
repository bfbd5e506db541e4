"""Rows of `inputs_tried.py` about folders of a user who knows none of the conventions here."""

import zipfile
from pathlib import Path

import numpy as np
from builders import builder
from depth_folders import true_depth
from input_kinds import (
    MATRIX,
    Row,
    baseline,
    calibrated,
    centred,
    close,
    common,
    depth,
    depth_files,
    depth_is_true,
    files,
    folder_of,
    half_excluded,
    labels,
    mask,
    masked,
    named,
    prepare,
    ros_text,
    tiff,
    trajectory,
    video,
)
from made_videos import pictures, woven
from odd_inputs import with_camera

from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import FILE_NAME
from synthetic_folder import write_synthetic_folder

EULER = ["t,x,y,z,roll,pitch,yaw", *(f"{i / 25},{i},0,0,0,0,90" for i in range(12))]
P = "{}: 100 0 63.5 {} 0 100 47.5 0 0 0 1 0\n"
LINE = "{} {} 0 0 0 0 0 1"


def one_file(change):
    """The fourth picture is changed."""
    return folder_of(pictures(), change=lambda folder: change(folder / "clip/0003.png"))


def zeroed(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[:200] + bytes(len(data) - 400) + data[-200:])


def looped(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def no_focal_length(folder: Path) -> list[str]:
    """The EndoNeRF layout with a negative focal length in every row."""
    write_synthetic_folder(folder / "clip")
    rows = np.load(folder / "clip/poses_bounds.npy")
    rows[:, 14] = -rows[:, 14]
    np.save(folder / "clip/poses_bounds.npy", rows)
    return ["check", str(folder / "clip")]


def coloured_masks(folder: Path) -> None:
    for file in folder.iterdir():
        write_png(file, np.dstack([mask(), mask(0), mask(0)]))


def missing_calibration(folder: Path) -> list[str]:
    files(folder, "clip", pictures())
    return prepare("clip", "--calibration", str(folder / "scope"), camera=())(folder)


def empty(folder: Path) -> list[str]:
    (folder / "clip").mkdir()
    return prepare("clip")(folder)


def zipped(folder: Path) -> list[str]:
    files(folder, "clip", pictures())
    with zipfile.ZipFile(folder / "clip.zip", "w") as archive:
        for file in (folder / "clip").iterdir():
            archive.write(file, file.name)
    return prepare("clip.zip")(folder)


def exr(path: Path, plane) -> None:
    path.write_bytes(b"\x76\x2f\x31\x01" + bytes(60))


def npy(kind):
    return lambda path, plane: np.save(path, plane.astype(kind))


def quotes(folder: Path) -> list[str]:
    """A folder whose name has spaces, quotes and a dollar sign."""
    files(folder, "my 'clip' \"1\" $HOME", pictures())
    return prepare("my 'clip' \"1\" $HOME")(folder)


def letterbox(count=12):
    found = pictures(count)
    for shown in found:
        shown[:16], shown[-16:] = 0, 0
    return found


@builder
def edited(folder: Path, name: str, change) -> list[str]:
    """A text file of the common format with other bytes."""
    words = common()(folder)
    file = folder / "clip" / name
    file.write_bytes(change(file.read_bytes()))
    return words


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
LINES = [LINE.format(f"{i / 25:.2f}", f"{0.001 * i:.4f}") for i in range(12)]
INTERLACED_PAIR = [np.hstack([p, p]) for p in woven()]
STRANGER_ROWS = [
    Row("masks, with a palette of black and white", masked([mask()] * 12, change=labels(255, 255, 255)), "right", "",
        half_excluded),
    Row("video, H.265 4:2:2 10 bit", video("a.mp4", codec="libx265", layout="yuv422p10le"), "right", "",
        close(pictures())),
    Row("pictures, one empty file", one_file(lambda path: path.write_bytes(b"")), "refused", "0003.png"),
    Row("pictures, one with zeros inside", one_file(zeroed), "refused", "0003.png"),
    Row("pictures, a link to itself", one_file(looped), "refused", "0003.png"),
    Row("pictures, a name with a line break", one_file(lambda path: path.rename(path.with_name("00\n03.png"))),
        "refused", "use"),
    Row("names with spaces, quotes and a dollar sign", quotes, "right", "", close(pictures(), 0.01)),
    Row("names in capitals", named(lambda k: f"{k:04d}.PNG"), "right", "", close(pictures(), 0.01)),
    Row("a folder above the pictures", calibrated("calib.txt", P.format("P2", 4), folders=["first try"]), "refused",
        "it holds the folders first try;"),
    Row("names of copies", named(lambda k: f"IMG_{k:04d} (2).png"), "right", "", close(pictures(), 0.01)),
    Row("pictures, heic", named(lambda k: f"{k:04d}.heic"), "refused", "12 files that end in .heic; convert"),
    Row("a zip file", zipped, "refused", "an archive; unpack it first"),
    Row("a folder that is not there", prepare("nothing"), "refused", "not found"),
    Row("pictures, letterbox", folder_of(letterbox()), "told", "--crop 0 16 128 64 keeps the rest"),
    Row("video, interlaced, side by side", video("a.mp4", INTERLACED_PAIR, "--stereo", "side_by_side", "--baseline",
        "4", options={"flags": "+ildct+ilme", "x264-params": "interlaced=1:tff=1"}), "told", "is interlaced"),
    Row("depth, half-float TIFF", depth_files(lambda path, plane: tiff(path,
        plane.astype("<f2").view("<u2"), sign=3), ".tiff"), "refused",
        "numbers of 16 or 64 bits"),
    Row("depth, EXR", depth_files(exr, ".exr"), "refused", "OpenEXR is not read; convert it"),
    Row("depth, half-float npy", depth_files(npy(np.float16), ".npy"), "right", ""),
    Row("depth, int32 npy", depth_files(npy(np.int32), ".npy"), "right", ""),
    Row("depth, grey with three channels", depth_files(lambda path, plane: write_png(path,
        np.repeat(plane.round().astype(np.uint8)[..., None], 3, axis=2)), ".png"), "right", ""),
    Row("depth, steps stated", depth_files(lambda path, plane: np.save(path, (plane * 256).astype(np.uint16)), ".npy",
        "--depth-scale", "0.00390625"), "right", "", depth_is_true),
    Row("camera of another size", with_camera("1000", "1000", "960", "540"), "refused",
        "is the calibration of another picture size?"),
    Row("camera with a negative focal length", with_camera("-100", "100", "64", "48"), "refused",
        "focal length -100: use numbers > 0"),
    Row("camera with decimal commas", with_camera("100,5", "100,5", "64", "48"), "refused", "100,5"),
    Row("camera, principal point in parts of the picture", with_camera("100", "100", "0.5", "0.5"), "told",
        "principal-point"),
    Row("trajectory with decimal commas", trajectory([line.replace(".", ",") for line in LINES]), "refused",
        "write decimal points"),
    Row("trajectory with semicolons", trajectory([line.replace(" ", ";") for line in LINES]), "told",
        "one pose per frame"),
    Row("trajectory whose stamps go back", trajectory(LINES[::-1]), "told",
        "line 2: stamps go back: the poses are sorted"),
    Row("trajectory with a stamp twice", trajectory([*LINES[:4], LINES[3], *LINES[4:]]), "refused", "twice"),
    Row("trajectory with a quaternion of zeros", trajectory([*LINES[:11], "0.44 0 0 0 0 0 0 0"]), "refused",
        "quaternion"),
    Row("trajectory with a byte order mark and CRLF", trajectory(("\ufeff" + "\r\n".join(LINES)).encode(),
        "--source-rate", "25"),
        "told", "one pose per frame"),
    Row("trajectory in UTF-16", trajectory("\n".join(LINES).encode("utf-16")), "refused",
        "not UTF-8 text"),
    Row("common format, sequence.toml with a byte order mark and CRLF", edited(FILE_NAME,
        lambda data: b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n")), "right", ""),
    Row("common format, sequence.toml with decimal commas", edited(FILE_NAME,
        lambda data: data.replace(b"fx = 3", b"fx = 3,")), "refused", FILE_NAME),
    Row("calibration, calib.txt of KITTI, P2 and P3 alone", calibrated("calib.txt",
        P.format("P2", 4) + P.format("P3", -36), folders=SIDES), "told", "P2 and P3 are read", baseline(400)),
    Row("calibration, calib.txt of KITTI, one camera", calibrated("calib.txt", P.format("P2", 4)), "told",
        "P2 is read as one camera, without a baseline", centred),
    Row("calibration, calib_cam_to_cam.txt of KITTI", calibrated("calib_cam_to_cam.txt", RAW_KITTI,
        folders=SIDES), "told", "P_rect", baseline(400)),
    Row("calibration, P1 and P2 of OpenCV", calibrated("a.yaml", RECTIFIED, folders=SIDES), "told", "P2", baseline(4)),
    Row("calibration, a projection with a baseline as text", calibrated("K.txt",
        "100 0 63.5 -40\n0 101 47.5 0\n0 0 1 0\n"), "refused", "fourth column"),
    Row("calibration, matrix with decimal commas", calibrated("K.txt", MATRIX.replace(".", ",")), "refused",
        "write decimal points"),
    Row("calibration, P1 and P2 of unlike cameras", calibrated("a.yaml",
        RECTIFIED.replace("63.5, -400", "93.5, -400"), folders=SIDES), "refused", "CALIB_ZERO_DISPARITY"),
    Row("calibration, P1 and P2 of a pair above one another", calibrated("a.yaml", RECTIFIED.replace(
        "-400., 0., 100., 47.5, 0.", "0., 0., 100., 47.5, -400."), folders=SIDES), "refused", "above or below it"),
    Row("calibration, ROS, the right camera alone", calibrated("a.yaml", ros_text(
        projection_matrix={"rows": 3, "cols": 4, "data": [float(value) for value in RIGHT]})), "told",
        "a right camera"),
    Row("one picture twice in the folder as jpg and png", folder_of(pictures(),
        change=lambda folder: write_jpeg(folder / "clip/0003.jpg", read_png(folder / "clip/0003.png"))), "refused",
        "carry the same frame number"),
    Row("calibration that is not there", missing_calibration, "refused", "scope: not found"),
    Row("calibration, YAML with tabs", calibrated("a.yaml", "camera_matrix:\n\tdata: [1]\n"), "refused",
        "cannot start any token (line 2)"),
    Row("calibration, matrix K as csv", calibrated("K.csv", MATRIX.replace(" ", ",")), "told",
        "half a pixel was added", centred),
    Row("trajectory with angles", trajectory(EULER), "refused", "write quaternions"),
    Row("trajectory, matrices in brackets", trajectory([str(np.eye(4).tolist())] * 12), "told",
        "stamps are frame numbers"),
    Row("pictures of two cameras by their last number", named(lambda k: f"{k // 2:04d}_{k % 2}.png"), "told",
        "if these are two cameras"),
    Row("an empty folder", empty, "refused", "the folder is empty"),
    Row("depth, negative", depth(lambda i: -true_depth(i)), "refused", "all values are negative"),
    Row("depth, one frame marked -1 everywhere", depth(lambda i: true_depth(i) * 0 - 1 if i == 3 else true_depth(i)),
        "told", "frames without any depth: 3"),
    Row("depth, centimetres", depth(lambda i: true_depth(i) / 10), "told", "if that is too near"),
    Row("masks, red", masked([mask()] * 12, change=coloured_masks), "refused", "--excluded-value nonzero"),
    Row("EndoNeRF, a negative focal length", no_focal_length, "refused", "must be positive"),
    Row("--frames with a hyphen", folder_of(pictures(), "--frames", "0-5"), "refused", "--frames"),
    Row("--scale 0", folder_of(pictures(), "--scale", "0"), "refused", "scale"),
    Row("--rate below 0", video("a.mp4", None, "--rate", "-5"), "refused", "rate"),
]  # fmt: skip
