"""Rows of `inputs_tried.py` about folders as other programs leave them: models, pairs, copies, trajectories, marks."""

import json
import shutil
import tempfile
from functools import cache
from pathlib import Path

import av
import cv2
import numpy as np
from builders import builder
from input_kinds import (
    Row,
    both,
    centred,
    close,
    colmap,
    depth_files,
    depth_is_true,
    files,
    first_to_last,
    folder_of,
    half_excluded,
    mask,
    masked,
    pair,
    prepare,
    public,
    rated,
    reworded,
    sides,
    timed,
    video,
)
from made_videos import HEIGHT, WIDTH, picture, pictures, write
from raw_sources import scene_picture
from scipy.spatial.transform import Rotation

from endotsr.cli.main import main
from endotsr.clips.sequences.sequence_file import read_sequence_file

FRAMES = 6
ALL = [scene_picture(i) for i in range(FRAMES)]


def part_of(model: Path, out: Path, first: int, last: int) -> None:
    """A text model with some of the pictures of another one."""
    shutil.copytree(model, out)
    reworded("images.txt", first_to_last(2 * first, 2 * last))(out)


def two_models(raw: Path) -> None:
    """sparse/0 has two pictures, sparse/1 four."""
    (raw / "sparse/0").rename(raw / "whole")
    part_of(raw / "whole", raw / "sparse/0", 0, 2)
    part_of(raw / "whole", raw / "sparse/1", 2, FRAMES)
    shutil.rmtree(raw / "whole")


@builder
def moved(raw: Path, pictures: str, model: str) -> None:
    """Pictures and model in other places."""
    (raw / "images").rename(raw / "p")
    (raw / "sparse/0").rename(raw / "m")
    shutil.rmtree(raw / "sparse")
    for name, place in (("p", pictures), ("m", model)):
        (raw / place).parent.mkdir(parents=True, exist_ok=True)
        (raw / name).rename(raw / place)


@builder
def cameras(raw: Path, *factors: float) -> None:
    """One camera per picture, with these factors of the focal length."""
    model = raw / "sparse/0"
    (model / "cameras.txt").write_text(
        "".join(f"{k + 1} PINHOLE 64 48 {60 * f} {61 * f} 30.0 25.0\n" for k, f in enumerate(factors))
    )
    lines = (model / "images.txt").read_text().splitlines()
    for k in range(0, len(lines), 2):
        words = lines[k].split()
        words[8] = str(k // 2 % len(factors) + 1)
        lines[k] = " ".join(words)
    (model / "images.txt").write_text("\n".join(lines) + "\n")


def both_sides(raw: Path) -> None:
    """Pictures of left/ and right/ in one model: frames 0 to 2 of each."""
    listed = (raw / "sparse/0/images.txt").read_text()
    for k in range(FRAMES):
        side, number = ("left", k) if k < FRAMES // 2 else ("right", k - FRAMES // 2)
        name = f"{side}/{number:04d}.png"
        (raw / "images" / side).mkdir(exist_ok=True)
        (raw / f"images/frame{k:04d}.png").rename(raw / "images" / name)
        listed = listed.replace(f"frame{k:04d}.png", name)
    (raw / "sparse/0/images.txt").write_text(listed)


def focal(value: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").camera.fx, value, atol=1e-3)


COLMAP_ROWS = [
    Row("COLMAP, two models, the first is the small one", colmap(change=two_models), "told",
        "sparse/1 is read, the largest model; not read: sparse/0 (2 pictures)", close(ALL[2:], 0.01)),
    Row("COLMAP, two models, --model", colmap("--model", "sparse/0", change=two_models), "told", "as stated",
        close(ALL[:2], 0.01)),
    Row("COLMAP, --model that is not there", colmap("--model", "3", change=two_models), "refused",
        "use sparse/0 or sparse/1"),
    Row("COLMAP, a picture that is not registered", colmap(change=reworded("sparse/0/images.txt",
        first_to_last(0, -2))), "told",
        "1 pictures are not registered", close(ALL[:-1], 0.01)),
    Row("COLMAP, dense/0/sparse", colmap(change=moved("dense/0/images", "dense/0/sparse")), "right", "",
        close(ALL, 0.01)),
    Row("COLMAP, input/ and distorted/", colmap(change=moved("input", "distorted/sparse/0")), "right", "",
        close(ALL, 0.01)),
    Row("COLMAP, no points3D", colmap(change=lambda raw: (raw / "sparse/0/points3D.txt").unlink()), "told",
        "training needs depth", close(ALL, 0.01)),
    Row("COLMAP, one camera per picture", colmap(change=cameras(1.0, 1.001, 0.999)), "told",
        "one camera per picture", focal(60)),
    Row("COLMAP, cameras that differ", colmap(change=cameras(1.0, 1.1)), "refused",
        "the cameras of the pictures differ"),
    Row("COLMAP, left and right in one model", colmap(change=both_sides), "told", "3 pictures of right/ not read",
        close(ALL[:3], 0.01)),
]  # fmt: skip


@cache
def moving_clip() -> tempfile.TemporaryDirectory:
    """A clip of a moving scope, which is simulated once."""
    kept = tempfile.TemporaryDirectory()
    size = ["--width", "160", "--height", "128", "--frames", "14"]
    assert main(["simulate", "moving-camera", "--out", f"{kept.name}/clip", *size, "-q"]) == 0
    return kept


def moving(folder: Path) -> None:
    """A copy of this clip; its poses stay in true.npy."""
    shutil.copytree(f"{moving_clip().name}/clip", folder / "clip")
    np.save(folder / "true.npy", np.load(folder / "clip/poses_bounds.npy")[:, :15])


def llff(folder: Path) -> None:
    """The axes that LLFF's own tool writes: down, right, backward."""
    moving(folder)
    rows = np.load(folder / "clip/poses_bounds.npy")
    for row in rows:
        matrix = row[:15].reshape(3, 5)
        right, up, back = matrix[:, :3].T.copy()
        matrix[:, 0], matrix[:, 1], matrix[:, 2] = -up, right, back
    np.save(folder / "clip/poses_bounds.npy", rows)


@builder
def llff_prepared(folder: Path, *words: str) -> list[str]:
    llff(folder)
    return prepare("clip", *words, camera=())(folder)


def llff_trained(folder: Path) -> list[str]:
    llff(folder)
    return ["train", str(folder / "clip"), "--out", str(folder / "run"), "--iterations", "2", "-q"]


def true_poses(folder: Path, kept: slice = slice(None), tolerance: float = 1e-4) -> bool:
    """The written poses are those of the kept frames of the clip."""
    written = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)[kept]
    turns = (true[:, :, :3] * [1.0, -1.0, -1.0]).transpose(0, 2, 1)
    shifts = -np.einsum("nij,nj->ni", turns, true[:, :, 3])
    return np.allclose(written, np.concatenate([turns, shifts[:, :, None]], axis=2), atol=tolerance)


POSE_ROWS = [
    Row("LLFF, axes of its own tool", llff_prepared(), "refused", "prepare --trajectory-axes llff"),
    Row("LLFF, axes of its own tool, training", llff_trained, "refused", "prepare --trajectory-axes llff"),
    Row("LLFF, --trajectory-axes llff", llff_prepared("--trajectory-axes", "llff"), "right", "", true_poses),
]  # fmt: skip
TWICE = [picture(i // 2) for i in range(40)]
PULLED_DOWN = [picture(i - i // 5) for i in range(40)]
COPY_ROWS = [
    Row("video, every picture twice, coded", video("a.mp4", TWICE, options={"crf": "28"}), "told",
        "every second frame repeats the one before (20 of 40 frames"),
    Row("video, every picture twice, --frames ::2", video("a.mp4", TWICE, "--frames", "::2"), "right", "",
        close(TWICE[::2])),
    Row("video, 24 a second stored as 30", video("a.mp4", PULLED_DOWN, options={"crf": "28"}), "told",
        "1 of every 5 frames repeat"),
    Row("pictures, every picture twice", folder_of(TWICE), "told", "without the copies: --frames ::2"),
]  # fmt: skip
GROUPS = {"g": "12", "bf": "2"}  # options of the encoder: a whole picture in twelve
WITH_A_PAUSE = [40 * i + 1500 * (i > 20) for i in range(60)]
PAUSE = [*range(0, 240, 40), *range(5000, 5240, 40)]  # milliseconds


def hidden_lead_in(folder: Path) -> list[str]:
    """An mp4 whose edit list hides the first five pictures, as a cut without coding leaves it."""
    write(folder / "whole.mp4", pictures(24), options=GROUPS)
    how = {"avoid_negative_ts": "disabled"}
    with av.open(str(folder / "whole.mp4")) as whole, av.open(str(folder / "a.mp4"), "w", options=how) as out:
        source = whole.streams.video[0]
        stream = out.add_stream_from_template(source)
        for packet in whole.demux(source):
            if packet.size:
                lead = 5 * packet.duration
                packet.pts, packet.dts, packet.stream = packet.pts - lead, packet.dts - lead, stream
                out.mux(packet)
    return prepare("a.mp4")(folder)


CLOCK_ROWS = [
    Row("video, lead-in hidden by an edit list", hidden_lead_in, "right", "", close(pictures(24)[5:])),
    Row("video, begins inside a group of pictures", video("a.ts", pictures(40), options=GROUPS,
        change=lambda path: path.write_bytes(path.read_bytes()[188 * 10 :])), "told",
        "coded pictures cannot be decoded and are left out", close(pictures(40)[12:])),
    Row("video, two files joined, the clock goes back", video("a.ts", pictures(40),
        change=lambda path: path.write_bytes(path.read_bytes() * 2)), "told", "its clock goes back",
        both(close(pictures(40) * 2), rated(25))),
    Row("video, a clock that jumps", video("a.mkv", None, milliseconds=PAUSE), "refused", "its clock jumps by 4.8 s"),
    Row("video, a clock that jumps, --source-rate", video("a.mkv", None, "--source-rate", "25", milliseconds=PAUSE),
        "told", "its clock jumps by 4.8 s", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, a pause in a long clip", video("a.mkv", pictures(60), milliseconds=WITH_A_PAUSE), "told",
        "its clock jumps by 1.54 s after picture 20", both(close(pictures(60)), timed(WITH_A_PAUSE))),
]  # fmt: skip


def points_of_scared(path: Path, z: np.ndarray) -> None:
    """Depth as SCARED stores it: x y z in float32, NaN without depth."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    points = np.stack([(u - 63.5) / 100 * z, (v - 47.5) / 100 * z, z], axis=2).astype(np.float32)
    cv2.imwrite(str(path), points[..., ::-1])


DEPTH_ROWS = [
    Row("depth, points x y z of SCARED", depth_files(points_of_scared, ".tiff"), "right", "", depth_is_true),
]
MOVED = [np.roll(shown, -5, axis=1) for shown in pictures()]


@builder
def two_videos(folder: Path, *words: str, names=("left.mkv", "right.mkv"), right=MOVED) -> list[str]:
    """A folder with a video of each camera."""
    (folder / "clip").mkdir()
    for name, frames in zip(names, (pictures(), right)):
        write(folder / "clip" / name, frames, codec="ffv1", layout="bgr0")
    return prepare("clip", "--baseline", "4", *words)(folder)


def second_video(folder: Path) -> list[str]:
    two_videos(names=("a.mkv", "b.mkv"))(folder)
    return prepare("clip/a.mkv", "--right", str(folder / "clip/b.mkv"), "--baseline", "4")(folder)


def second_folder(folder: Path) -> list[str]:
    for name, frames in (("one", pictures()), ("other", MOVED)):
        files(folder, name, frames)
    return prepare("one", "--right", str(folder / "other"), "--baseline", "4")(folder)


def two_folders(left: str, right: str):
    return pair(names=(left, right), frames=(pictures(), MOVED))


pairs_kept = sides(pictures(), MOVED, 0)


@builder
def renamed_video(folder: Path, name: str, **how) -> list[str]:
    """A video under a name that does not end like one."""
    write(folder / f"a.{how.pop('kind')}", pictures(), **how)
    next(folder.glob("a.*")).rename(folder / name)
    return prepare(name)(folder)


PAIR_ROWS = [
    Row("stereo, two videos in a folder", two_videos(), "right", "", pairs_kept),
    Row("stereo, two videos of unlike length", two_videos(right=MOVED[:9]), "refused", "count 9, of left.mkv 12"),
    Row("stereo, --right with a video", second_video, "right", "", pairs_kept),
    Row("stereo, --right with a folder", second_folder, "right", "", pairs_kept),
    Row("stereo, left_frames/ and right_frames/", two_folders("left_frames", "right_frames"), "right", "",
        pairs_kept),
    Row("stereo, left_rectified/ and right_rectified/", two_folders("left_rectified", "right_rectified"), "right",
        "", pairs_kept),
    Row("video of a recorder, .VOB", renamed_video("A.VOB", kind="mpg", codec="mpeg2video", options={"b": "4000000"}),
        "right", "", close(pictures())),
    Row("video without an ending", renamed_video("recording", kind="mkv"), "right", "", close(pictures())),
    Row("video, .flv", renamed_video("a.flv", kind="flv"), "right", "", close(pictures())),
]  # fmt: skip


def matrices(folder: Path) -> np.ndarray:
    """The true camera-to-world matrices (n, 3, 4) of a clip of a moving scope."""
    moving(folder)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)
    return np.concatenate([true[:, :, :3] * [1.0, -1.0, -1.0], true[:, :, 3:4]], axis=2)


@builder
def with_poses(folder: Path, name: str, rows, write_rows) -> list[str]:
    """Pictures and depth of a moving scope with its trajectory in another form."""
    write_rows(folder / name, rows(matrices(folder)))
    clip = folder / "clip"
    lens = ("--camera", *map(str, lens_of(clip)))
    words = ["--trajectory", str(folder / name), "--trajectory-unit", "mm", "--depth", str(clip / "depth")]
    return prepare("clip/images", *words, camera=lens)(folder)


def lens_of(clip: Path) -> tuple[float, ...]:
    focal = float(np.load(clip / "poses_bounds.npy")[0, 14])
    return focal, focal, 80.0, 64.0


def kitti(found: np.ndarray) -> np.ndarray:
    return found.reshape(len(found), 12)


def squared(found: np.ndarray) -> np.ndarray:
    last = np.broadcast_to(np.array([[[0.0, 0, 0, 1]]]), (len(found), 1, 4))
    return np.concatenate([found, last], axis=1)


def euroc(found: np.ndarray) -> np.ndarray:
    """Stamp in nanoseconds, position, quaternion w x y z."""
    turns = Rotation.from_matrix(found[:, :, :3]).as_quat()[:, [3, 0, 1, 2]]
    return np.column_stack([1e18 + 4e7 * np.arange(len(found)), found[:, :, 3], turns])


def with_head(path: Path, rows: np.ndarray) -> None:
    np.savetxt(path, rows, delimiter=",", header="timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", comments="")


TRAJECTORY_ROWS = [
    Row("trajectory of KITTI", with_poses("kitti.txt", kitti, np.savetxt), "told", "positions in mm", true_poses),
    Row("trajectory, npy of 4x4 matrices", with_poses("poses.npy", squared, np.save), "told", "positions in mm",
        true_poses),
    Row("trajectory of EuRoC, w x y z by a head line without a mark", with_poses("data.csv", euroc, with_head), "told",
        "positions in mm", true_poses),
    Row("trajectory of KITTI, a pose missing", with_poses("kitti.txt", lambda m: kitti(m)[1:], np.savetxt), "refused",
        "13 poses without stamps for 14 frames"),
]  # fmt: skip


def objects(i: int) -> np.ndarray:
    """Numbers of two instruments: 1 and 2."""
    return mask(1) + mask(1) * (np.arange(WIDTH) < 20).astype(np.uint8)


def as_blender(raw: Path) -> None:
    """Field of view in place of the focal length, no endings, transforms_train.json."""
    file = raw / "transforms.json"
    frames = json.loads(file.read_text().replace(".png", ""))["frames"]
    kept = [{key: frame[key] for key in ("file_path", "transform_matrix")} for frame in frames]
    (raw / "transforms_train.json").write_text(
        json.dumps({"camera_angle_x": float(2 * np.arctan(0.64)), "frames": kept})
    )
    file.unlink()


OTHER_ROWS = [
    Row("masks, numbers of objects, --excluded-value nonzero", masked([objects(0)] * 12, "--excluded-value", "nonzero"),
        "right", "", half_excluded),
    Row("nerfstudio, separators of Windows", public("nerfstudio", change=reworded("transforms.json",
        lambda text: text.replace("./images/", ".\\\\images\\\\"))), "told",
        "unit of lengths unknown", centred),
    Row("nerfstudio, --trajectory-unit", public("nerfstudio", "--trajectory-unit", "m"), "told", "unit of lengths m",
        lambda folder: read_sequence_file(folder / "o").unit == "mm"),
    Row("Blender, transforms_train.json", public("nerfstudio", change=as_blender), "told", "transforms_train.json",
        lambda folder: np.isclose(read_sequence_file(folder / "o").camera.fx, 100)),
]  # fmt: skip
LEFT_ROWS = [*COLMAP_ROWS, *POSE_ROWS, *COPY_ROWS, *CLOCK_ROWS, *DEPTH_ROWS, *PAIR_ROWS, *TRAJECTORY_ROWS, *OTHER_ROWS]
