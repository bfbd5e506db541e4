"""SCARED: the folder of a keyframe, with stereo video, calibration and kinematics.

endoscope_calibration.yaml        OpenCV: M1 D1 M2 D2 R T, millimetres (camera_calibration.yaml in some copies)
data/rgb.mp4                      left over right
data/frame_data.tar.gz            or data/frame_data/: one JSON per frame, camera-pose (4x4), world-to-camera, mm

Structured-light depth belongs to unrectified pictures and is not read; `endotsr depth` matches the pairs.
"""

import gzip
import io
import re
import tarfile
import zlib
from dataclasses import replace
from pathlib import Path

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL
from endotsr.clips.formats.camera import checked_rotation, rows_of_motion
from endotsr.clips.formats.files import frame_numbers, shortened, visible_files
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.layouts import Layout
from endotsr.clips.sequences.layouts.video import describe_video
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.errors import InputError
from endotsr.method.splatting.camera import CameraPose
from endotsr.untrusted.files import open_regular, read_text
from endotsr.untrusted.json import parsed
from endotsr.untrusted.names import plain_line
from endotsr.untrusted.yaml import matrix

CALIBRATIONS = ("endoscope_calibration.yaml", "camera_calibration.yaml")
VIDEO, FOLDER, ARCHIVE = "data/rgb.mp4", "data/frame_data", "data/frame_data.tar.gz"
FRAME = Inventory(
    "the file of a frame of SCARED, in frame_data",
    used={"camera-pose": "world-to-camera, millimetres"},
    told={"camera-calibration": "the calibration of the keyframe is used for all frames"},
    harmless={"timestamp": "the video states the times"},
)
FILES = Inventory(
    "the folder of a keyframe of SCARED",
    used={
        "endoscope_calibration.yaml camera_calibration.yaml": "both cameras; the first of the two files",
        "data": "rgb.mp4: the pairs; frame_data or frame_data.tar.gz: the poses",
    },
    told={
        "left_depth_map.tif* right_depth_map.tif* point_cloud.obj scene_points scene_points.tar.gz": "structured light"
        " of pictures that are not rectified is not read: endotsr depth matches the pairs",
    },
    harmless={"left_image.png right_image.png": "the first pair of the video"},
)
IN_DATA = ("rgb.mp4", "frame_data", "frame_data.tar.gz", "scene_points", "scene_points.tar.gz")
LARGEST_FILE, MOST_FILES = 1 << 20, 1 << 17  # bytes of the JSON of a frame; frames
LARGEST_ARCHIVE = 1 << 28  # bytes of frame_data.tar.gz, packed or unpacked


def _calibration(path: Path) -> Path | None:
    return next((path / name for name in CALIBRATIONS if (path / name).is_file()), None)


def recognises(path: Path) -> bool:
    """Whether a path is the folder of a keyframe."""
    return (path / VIDEO).is_file() and _calibration(path) is not None


def describe_scared(path: Path, options: SourceOptions) -> Clip:
    """The keyframe as a clip. Raises InputError."""
    calibration = options.calibration or _calibration(path)
    if calibration is None or not (path / VIDEO).is_file():
        raise InputError(f"{path}: use a folder with {VIDEO} and {CALIBRATIONS[0]}")
    stated = replace(options, stereo="stacked", calibration=calibration)
    clip = describe_video(path / VIDEO, stated)
    inside = sorted(entry.name for folder in (path, path / "data") for entry in folder.iterdir())
    notes, poses = [*clip.notes, *FILES.telling(inside, path.name)], clip.poses
    if options.calibration is None:
        notes.append(f"{calibration.name}: {HALF_A_PIXEL}; T in millimetres")
    if poses is None:
        poses = _poses(path, clip.count, notes)
        kinematics = (
            "camera-pose of the kinematics: read as world-to-camera, millimetres; its authors report errors in it"
        )
        notes.append(kinematics if poses else f"{FOLDER} is missing: the camera counts as static")
    read = (calibration.name.lower(),) if options.calibration is None else ()
    inside = {path / "data": IN_DATA, path / FOLDER: ("*.json",)}
    return replace(
        clip, layout="scared", where=path, poses=poses, unit="mm", notes=notes, read_here=read, inside=inside
    )


def _poses(path: Path, count: int, notes: list[str]) -> list[CameraPose | None] | None:
    """World-to-camera poses of the frames; None without files.

    One file for each frame belongs to them in order; otherwise a file belongs to the frame with its number.
    """
    texts = frame_texts(path)
    if not texts:
        return None
    numbers = frame_numbers([Path(name) for name, _ in texts])
    in_order = len(texts) == count or numbers is None or len(numbers[0]) != 1
    found: list[CameraPose | None] = [None] * count
    unused, said = [], []
    for k, (name, content) in enumerate(texts):
        place = k if in_order or numbers is None else numbers[k][0]
        where = f"{path / FOLDER / name}: camera-pose"
        data = parsed(content, where)
        said += FRAME.noted(data, FOLDER) if isinstance(data, dict) else []
        if not 0 <= place < count:
            unused.append(name)
            continue
        stored = matrix(data.get("camera-pose") if isinstance(data, dict) else None, where, (4, 4))
        rotation, translation = rows_of_motion(stored, where)
        found[place] = CameraPose(checked_rotation(rotation, where), translation)
    notes += sorted(set(said))
    notes += [f"{FOLDER}: of no frame, not used: {shortened(unused)}"] if unused else []
    return found


def frame_texts(path: Path) -> list[tuple[str, str | bytes]]:
    """Names and contents of the JSON files, in the order of the numbers in their names."""
    if (path / FOLDER).is_dir():
        files = sorted(visible_files(path / FOLDER, "*.json"), key=lambda file: _in_order(file.name))
        _refuse_many(path / FOLDER, len(files))
        return [(file.name, read_text(file, LARGEST_FILE)) for file in files]
    if not (path / ARCHIVE).is_file():
        return []
    found = {}
    try:
        with tarfile.open(fileobj=io.BytesIO(_unpacked(path / ARCHIVE)), mode="r:") as archive:
            for member in archive:
                name = Path(member.name).name
                if member.isfile() and name.endswith(".json") and name[0] != ".":
                    _refuse_member(path / ARCHIVE, member, name in found)
                    stream = archive.extractfile(member)
                    found[name] = stream.read(LARGEST_FILE) if stream else b""
                    _refuse_many(path / ARCHIVE, len(found))
    except (tarfile.TarError, OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path / ARCHIVE}: cannot be read: {error}") from None
    return sorted(found.items(), key=lambda entry: _in_order(entry[0]))


def _refuse_member(archive: Path, member: tarfile.TarInfo, twice: bool) -> None:
    """Raises InputError for a file that is too large for one frame, or whose name another folder there has too."""
    if member.size > LARGEST_FILE:
        most = f"{LARGEST_FILE >> 20} MiB"
        raise InputError(f"{archive}: {plain_line(member.name)} is larger than {most}; use JSON of one frame")
    if twice:
        raise InputError(f"{archive}: {plain_line(member.name)}: two files have this name; use one per frame")


def _refuse_many(where: Path, count: int) -> None:
    """Raises InputError for more files than a recording can have frames."""
    if count > MOST_FILES:
        raise InputError(f"{where}: more than {MOST_FILES} files; use one JSON per frame")


def _unpacked(file: Path) -> bytes:
    """The content of a .gz file. Raises InputError for one that unpacks to more than LARGEST_ARCHIVE bytes."""
    with open_regular(file, LARGEST_ARCHIVE) as packed, gzip.GzipFile(fileobj=packed) as stream:
        content = stream.read(LARGEST_ARCHIVE + 1)
    if len(content) > LARGEST_ARCHIVE:
        raise InputError(f"{file}: unpacks to more than {LARGEST_ARCHIVE >> 20} MiB; use at most that")
    return content


def _in_order(name: str) -> list[str | int]:
    """A key that sorts names by the numbers in them, with or without leading zeros."""
    return [int(part) if k % 2 else part for k, part in enumerate(re.split(r"(\d+)", name))]


LAYOUT = Layout(
    name="scared",
    about=f"a keyframe of SCARED with {VIDEO} and {CALIBRATIONS[0]}",
    rank=2,
    recognises=recognises,
    describe=describe_scared,
    takes=("calibration", "trajectory", "masks"),
    reads=tuple(name for name in FILES.listed if not name.endswith(".yaml")),
)
