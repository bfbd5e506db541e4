"""Rows of `inputs_tried.py` about folders as other programs leave them: models, pairs, copies, trajectories, marks."""

import shutil
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
import raw_sources
from input_kinds import Row, close, depth_is_true, folder_of, prepare, video
from made_videos import HEIGHT, WIDTH, picture, pictures, write
from raw_sources import scene_picture
from test_stated_depth import recording as with_depth
from test_stated_depth import true_depth

from endotsr.cli.main import main
from endotsr.clips.sequences.sequence_file import read_sequence_file

FRAMES = 6
ALL = [scene_picture(i) for i in range(FRAMES)]


def colmap(*words: str, binary: bool = False, change=lambda raw: None):
    """A COLMAP model of six frames as the input of `prepare`."""

    def make(folder: Path) -> list[str]:
        raw_sources.colmap(folder / "raw", binary, FRAMES)
        change(folder / "raw")
        return prepare("raw", *words, camera=())(folder)

    return make


def part_of(model: Path, out: Path, first: int, last: int) -> None:
    """A text model with some of the pictures of another one."""
    shutil.copytree(model, out)
    lines = (model / "images.txt").read_text().splitlines()
    (out / "images.txt").write_text("\n".join(lines[2 * first : 2 * last]) + "\n")


def two_models(raw: Path) -> None:
    """sparse/0 has two pictures, sparse/1 four."""
    (raw / "sparse/0").rename(raw / "whole")
    part_of(raw / "whole", raw / "sparse/0", 0, 2)
    part_of(raw / "whole", raw / "sparse/1", 2, FRAMES)
    shutil.rmtree(raw / "whole")


def one_unregistered(raw: Path) -> None:
    (raw / "sparse/0").rename(raw / "whole")
    part_of(raw / "whole", raw / "sparse/0", 0, FRAMES - 1)
    shutil.rmtree(raw / "whole")


def moved(pictures: str, model: str):
    """Pictures and model in other places."""

    def change(raw: Path) -> None:
        (raw / "images").rename(raw / "p")
        (raw / "sparse/0").rename(raw / "m")
        shutil.rmtree(raw / "sparse")
        for name, place in (("p", pictures), ("m", model)):
            (raw / place).parent.mkdir(parents=True, exist_ok=True)
            (raw / name).rename(raw / place)

    return change


def cameras(*factors: float):
    """One camera per picture, with these factors of the focal length."""

    def change(raw: Path) -> None:
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

    return change


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
        "allowed: sparse/0, sparse/1"),
    Row("COLMAP, a picture that is not registered", colmap(change=one_unregistered), "told",
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


def moving(folder: Path) -> None:
    """A clip of a moving scope; its poses stay in true.npy."""
    size = ["--width", "160", "--height", "128", "--frames", "14"]
    assert main(["simulate", "moving-camera", "--out", str(folder / "clip"), *size, "-q"]) == 0
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


def llff_prepared(*words: str):
    def make(folder: Path) -> list[str]:
        llff(folder)
        return prepare("clip", *words, camera=())(folder)

    return make


def llff_trained(folder: Path) -> list[str]:
    llff(folder)
    return ["train", str(folder / "clip"), "--out", str(folder / "run"), "--iterations", "2", "-q"]


def true_poses(folder: Path) -> bool:
    """The written poses are those of the clip."""
    written = np.array(read_sequence_file(folder / "o").poses.matrices).reshape(-1, 3, 4)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)
    turns = (true[:, :, :3] * [1.0, -1.0, -1.0]).transpose(0, 2, 1)
    shifts = -np.einsum("nij,nj->ni", turns, true[:, :, 3])
    return np.allclose(written, np.concatenate([turns, shifts[:, :, None]], axis=2), atol=1e-4)


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
PAUSE = [*range(0, 240, 40), *range(5000, 5240, 40)]  # milliseconds


def hidden_lead_in(folder: Path) -> list[str]:
    """An mp4 whose edit list hides the first five pictures, as a cut without coding leaves it."""
    import av

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


def begun_inside(path: Path) -> None:
    """The first packets of a transport stream are missing: it begins inside a group of pictures."""
    path.write_bytes(path.read_bytes()[188 * 10 :])


def twice_in_a_file(path: Path) -> None:
    path.write_bytes(path.read_bytes() * 2)


CLOCK_ROWS = [
    Row("video, lead-in hidden by an edit list", hidden_lead_in, "right", "", close(pictures(24)[5:])),
    Row("video, begins inside a group of pictures", video("a.ts", pictures(40), options=GROUPS, change=begun_inside),
        "told", "coded pictures cannot be decoded and are left out", close(pictures(40)[12:])),
    Row("video, two files joined, the clock goes back", video("a.ts", pictures(40), change=twice_in_a_file), "told",
        "its clock goes back", close(pictures(40) * 2)),
    Row("video, a clock that jumps", video("a.mkv", None, milliseconds=PAUSE), "refused", "its clock jumps by 4.8 s"),
    Row("video, a clock that jumps, --source-rate", video("a.mkv", None, "--source-rate", "25", milliseconds=PAUSE),
        "told", "its clock jumps by 4.8 s", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, a pause in a long clip", video("a.mkv", pictures(60), milliseconds=[40 * i + 1500 * (i > 20)
        for i in range(60)]), "told", "its clock jumps by 1.54 s", close(pictures(60))),
]  # fmt: skip


def points_of_scared(folder: Path) -> list[str]:
    """Depth as SCARED stores it: x y z in float32, NaN without depth."""
    import cv2

    words = with_depth(folder, true_depth)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    for i, file in enumerate(sorted((folder / "depth").iterdir())):
        file.unlink()
        z = true_depth(i)
        points = np.stack([(u - 63.5) / 100 * z, (v - 47.5) / 100 * z, z], axis=2).astype(np.float32)
        cv2.imwrite(str(file.with_suffix(".tiff")), points[..., ::-1])
    return words


DEPTH_ROWS = [Row("depth, points x y z of SCARED", points_of_scared, "right", "", depth_is_true)]
LEFT_ROWS = [*COLMAP_ROWS, *POSE_ROWS, *COPY_ROWS, *CLOCK_ROWS, *DEPTH_ROWS]
