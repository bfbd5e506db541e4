"""How the inputs of `inputs_tried.py` are made."""

import shutil
import struct
import tempfile
from functools import cache
from pathlib import Path

import av
import numpy as np
import public_layouts
from builders import builder
from made_videos import CAMERA, files, picture, pictures, write
from PIL import Image
from scipy.spatial.transform import Rotation

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png


def prepare(name: str, *words: str, camera=CAMERA):
    return lambda folder: ["prepare", str(folder / name), "--out", str(folder / "o"), *camera, *words]


@builder
def video(folder: Path, name: str, frames=None, *words: str, change=lambda path: None, **how) -> list[str]:
    """A video as the input of `prepare`."""
    write(folder / name, pictures() if frames is None else frames, **how)
    change(folder / name)
    return prepare(name, *words)(folder)


@builder
def each(folder: Path, name: str, change) -> None:
    """The pictures in a folder of it, changed."""
    for file in sorted((folder / name).iterdir()):
        write_png(file, change(read_png(file)))


@builder
def changed_bytes(path: Path, change) -> None:
    path.write_bytes(change(path.read_bytes()))


def cut(part: float):
    return changed_bytes(lambda data: data[: int(len(data) * part)])


@builder
def folder_of(folder: Path, frames, *words: str, ending="png", change=lambda folder: None, camera=CAMERA) -> list[str]:
    """Pictures in clip/."""
    files(folder, "clip", frames, ending)
    change(folder)
    return prepare("clip", *words, camera=camera)(folder)


def twelve(*words: str, **how):
    """The twelve usual pictures in clip/."""
    return folder_of(pictures(), *words, **how)


def put(path: Path, what) -> None:
    """Text, bytes, or what a function writes, as a file."""
    what(path) if callable(what) else path.write_bytes(what if isinstance(what, bytes) else what.encode())


@builder
def with_file(folder: Path, option: str, name: str, what, *words: str) -> list[str]:
    """The usual pictures, and a file of an option; see `put`."""
    put(folder / name, what)
    return twelve(option, str(folder / name), *words)(folder)


@builder
def pair(folder: Path, *words: str, names=("left", "right"), frames=None, change=lambda clip: None) -> list[str]:
    """The pictures of two cameras in two folders."""
    for name, shown in zip(names, frames or (pictures(), pictures())):
        files(folder / "clip", name, shown)
    change(folder / "clip")
    return prepare("clip", "--baseline", "4", *words)(folder)


def named(name, frames=None):
    """The pictures under other names, by their number."""

    def change(folder: Path) -> None:
        for k, file in enumerate(sorted((folder / "clip").iterdir())):
            file.rename(file.with_name(name(k)))

    return folder_of(frames or pictures(), change=change)


def rewritten(folder: Path, change=lambda opened: opened, ending="png", **how) -> None:
    """Every picture of a folder again, changed by Pillow."""
    for file in sorted(folder.iterdir()):
        with Image.open(file) as opened:
            made = change(opened.copy())
        file.unlink()
        more = [each.copy() for each in how.get("append_images", ())]  # saving as MPO leaves its settings in a picture
        made.save(file.with_suffix(f".{ending}"), **(how | {"append_images": more} if more else how))


@builder
def raw(folder: Path, write_raw, *words: str, change=lambda folder: None, camera=()) -> list[str]:
    """A folder of another program in raw/, changed."""
    write_raw(folder / "raw")
    change(folder / "raw")
    return prepare("raw", *words, camera=camera)(folder)


def public(layout: str, *words: str, change=lambda folder: None, **how):
    """A public layout; see `public_layouts`."""
    return raw(lambda folder: getattr(public_layouts, layout)(folder, **how), *words, change=change)


@builder
def calibrated(folder: Path, name: str, what, *words: str, folders=(".",)) -> list[str]:
    """Pictures in clip/, or in these folders of it, with a calibration; see `put`."""
    for place in folders:
        files(folder / "clip", place, pictures())
    put(folder / name, what)
    return prepare("clip", "--calibration", str(folder / name), *words, camera=())(folder)


MATRIX = "100 0 63.5\n0 101 47.5\n0 0 1\n"


@builder
def with_files(folder: Path, *names: str, text: str = "1") -> None:
    """Further files in a folder."""
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)


@builder
def without(folder: Path, name: str) -> None:
    """A file or a folder less."""
    shutil.rmtree(folder / name) if (folder / name).is_dir() else (folder / name).unlink()


@builder
def reworded(folder: Path, name: str, change) -> None:
    """A text file of a folder, changed."""
    (folder / name).write_text(change((folder / name).read_text()))


def replaced(name: str, old: str, new: str):
    return reworded(name, lambda text: text.replace(old, new))


def first_to_last(first: int, last: int | None = None, step: int = 1):
    """Some of the lines of a text."""
    return lambda text: "\n".join(text.splitlines()[first:last:step]) + "\n"


def tiff(path: Path, plane: np.ndarray, black_is_zero: int = 1, bits: int = 16, sign: int = 1) -> None:
    """A TIFF written by hand, with 0 as white if `black_is_zero` is 0; `sign`: 2 signed, 3 real numbers."""
    height, width = plane.shape
    data = np.packbits(plane, axis=1).tobytes() if bits == 1 else plane.astype(f"<u{bits // 8}").tobytes()
    tags = [(256, 4, width), (257, 4, height), (258, 3, bits), (259, 3, 1), (262, 3, black_is_zero), (273, 4, 8),
            (277, 3, 1), (278, 4, height), (279, 4, len(data)), (339, 3, sign)]  # fmt: skip
    directory = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in tags)
    path.write_bytes(
        b"II*\0" + struct.pack("<I", 8 + len(data)) + data + struct.pack("<H", len(tags)) + directory + bytes(4)
    )


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


TWICE = [picture(i // 2) for i in range(40)]
MOVED = [np.roll(shown, -5, axis=1) for shown in pictures()]


def matrices(folder: Path) -> np.ndarray:
    """The true camera-to-world matrices (n, 3, 4) of a clip of a moving scope."""
    moving(folder)
    true = np.load(folder / "true.npy").reshape(-1, 3, 5)
    return np.concatenate([true[:, :, :3] * [1.0, -1.0, -1.0], true[:, :, 3:4]], axis=2)


def lens_of(clip: Path) -> tuple[float, ...]:
    focal = float(np.load(clip / "poses_bounds.npy")[0, 14])
    return focal, focal, 80.0, 64.0


def squared(found: np.ndarray) -> np.ndarray:
    last = np.broadcast_to(np.array([[[0.0, 0, 0, 1]]]), (len(found), 1, 4))
    return np.concatenate([found, last], axis=1)


def quaternions(found: np.ndarray, order: str = "xyzw") -> np.ndarray:
    return Rotation.from_matrix(found[:, :, :3]).as_quat()[:, ["xyzw".index(axis) for axis in order]]


EUROC_HEAD = (
    "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m"
    " s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1],"
    " b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
)
P = "{}: 100 0 63.5 {} 0 100 47.5 0 0 0 1 0\n"


@builder
def of_all_frames(folder: Path, planes, option: str, name=lambda k: f"{k}.png") -> list[str]:
    """One array for the clip, in the order of these names sorted as text."""
    files(folder, "clip", pictures())
    for k, file in enumerate(sorted((folder / "clip").iterdir())):
        file.rename(file.with_name(name(k)))
    np.save(folder / "a.npy", np.stack([planes(k) for k in sorted(range(12), key=name)]))
    return [*prepare("clip")(folder), option, str(folder / "a.npy")]


EXCHANGED = [picture(0.5 * i) for i in (0, 1, 2, 3, 4, 5, 7, 6, 8, 9, 10, 11, 12, 13, 14, 15)]


def exif(orientation: int = 1, space: int = 1) -> bytes:
    made = Image.Exif()
    made[0x0112] = orientation
    made.get_ifd(0x8769)[0xA001] = space
    return made.tobytes()


GROUPS = {"g": "12", "bf": "2"}  # options of the encoder: a whole picture in twelve


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
