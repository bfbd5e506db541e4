"""What a path that no layout recognises is, with the remedy: DICOM, archives, arrays, other pictures, an outer folder.

In: the path. Out: the end of a refusal; "" if nothing follows from what is there.
"""

import re
import shlex
from collections import Counter
from pathlib import Path

from endotsr.clips.formats.files import shortened
from endotsr.clips.formats.video_file import LARGEST_FILE, VIDEO_ENDINGS
from endotsr.clips.sequences.record import is_run
from endotsr.errors import InputError
from endotsr.untrusted.files import open_regular
from endotsr.untrusted.json import read_json
from endotsr.untrusted.names import counted, plain_line

ARCHIVES = (".zip", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz", ".zst")
OTHER_PICTURES = (".heic", ".heif", ".avif", ".jp2", ".j2k", ".jxl", ".gif", ".tga", ".ppm", ".pgm", ".dng", ".psd",
                  ".exr", ".hdr", ".pnm", ".pbm")  # fmt: skip
ARRAYS = (".npy", ".npz", ".mat", ".h5", ".hdf5", ".pkl", ".bag")
RECORDINGS = {".db3": "a ROS bag", ".mcap": "a ROS bag", ".svo": "a recording of a ZED camera",
              ".svo2": "a recording of a ZED camera", ".pptx": "a presentation", ".pdf": "a document"}  # fmt: skip
AS_PICTURES = "frames in arrays are not read; write each as a png picture"
JPEG_NAMES = (".jfif", ".jpe", ".jif")  # of pictures that a browser saved
DICOM_ENDINGS = (".dcm", ".dicom", "")  # recorders also write names without an ending
EXPORT_DICOM = "export it as a video or as PNG pictures before, for example with the program that shows it"
OTHER_VIDEOS = (".gif", ".apng", ".y4m", ".ogv", ".ogg", ".ivf", ".mjpeg", ".mjpg", ".yuv")


def what_it_is(path: Path) -> str:
    """What a path in no known layout is, after a colon, with the remedy; "" if none follows from it."""
    return _of_file(path) if path.is_file() else _of_folder(path)


def not_there(path: Path) -> str:
    """Why a source is not found, for a message."""
    text = str(path)
    if re.match(r"[a-z]{2,}:/", text):  # a path has lost one of the two strokes
        return "is an address; download the file, and give its path"
    if re.search(r"[*?]|%\d*d", path.name):
        return f"not found; give the folder of the pictures, {path.parent}, without a pattern"
    if "\\" in text and Path(text.replace("\\", "/")).exists():
        return f"not found; write strokes in place of backslashes: {text.replace(chr(92), '/')}"
    return "not found"


def _of_file(path: Path) -> str:
    ending = path.suffix.lower()
    if is_dicom(path):
        return f": a DICOM file; {EXPORT_DICOM}"
    if ending in ARRAYS:
        return f": {AS_PICTURES}"
    if ending in ARCHIVES:
        return ": an archive; unpack it first"
    if ending in RECORDINGS:
        return f": {RECORDINGS[ending]}; export its pictures as a video or as PNG files"
    return ": a video in a format that is not read; convert it to mp4" if ending in OTHER_VIDEOS else ""


def _of_run(path: Path) -> str:
    """What is said of a run folder in place of a clip."""
    try:
        source = read_json(path / "run.json").get("input", {}).get("source")
    except (InputError, AttributeError):  # of damaged records, and of a run with windows
        source = None
    of = f"; it was trained on {plain_line(source)}" if isinstance(source, str) else ""
    return f": a run folder, not a clip{of}"


def _of_folder(path: Path) -> str:
    """A run is named; then the most frequent ending decides, then videos, then inner folders."""
    if is_run(path):
        return _of_run(path)
    dicom = sum(is_dicom(file) for file in path.iterdir() if file.suffix.lower() in DICOM_ENDINGS)
    if dicom:
        return f": it holds {counted(dicom, 'DICOM file')}; {EXPORT_DICOM}"
    endings = Counter(file.suffix.lower() for file in path.iterdir() if file.is_file() and file.suffix)
    ending, count = endings.most_common(1)[0] if endings else ("", 0)
    if ending in OTHER_PICTURES:
        return f": it holds {count} files that end in {ending}; convert them to png"
    if ending in ARRAYS:
        return f": it holds {counted(count, 'file')} of the ending {ending}; {AS_PICTURES}"
    if ending in ARCHIVES:
        return f": it holds {counted(count, 'archive')} of the ending {ending}; unpack first"
    if ending in JPEG_NAMES:
        return f": it holds {count} files that end in {ending}; let their names end in .jpg"
    videos = sorted(plain_line(file.name) for file in path.iterdir() if file.suffix.lower() in VIDEO_ENDINGS)
    if len(videos) == 1:
        source = shlex.quote(str(path / videos[0]))
        return f": it holds {videos[0]}, which `endotsr prepare {source} --out FOLDER` converts"
    if videos:
        return f": it holds {shortened(videos)}; give the video itself, and join the parts of one recording before"
    if not any(path.iterdir()):
        return ": the folder is empty"
    folders = sorted(plain_line(folder.name) for folder in path.iterdir() if folder.is_dir())
    return f": it holds the folders {shortened(folders)}; give the one with the pictures" if folders else ""


def is_dicom(path: Path) -> bool:
    """Whether a file is a regular one that has the mark of DICOM behind its preamble."""
    try:
        with open_regular(path, LARGEST_FILE) as file:
            return file.read(132)[128:] == b"DICM"
    except (OSError, InputError):
        return False
