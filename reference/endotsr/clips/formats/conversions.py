"""One line of Python that converts arrays in a container that is not read, such as pickle, which can run commands."""

import json
from pathlib import Path

LOADS = {  # ending -> package, and what loads a file named f
    ".pkl": ("pickle", 'pickle.load(open(f, "rb"))'),
    ".pickle": ("pickle", 'pickle.load(open(f, "rb"))'),
    ".pt": ("torch", 'torch.load(f, "cpu", weights_only=True)'),
    ".pth": ("torch", 'torch.load(f, "cpu", weights_only=True)'),
    ".mat": ("scipy.io", 'scipy.io.loadmat(f)["NAME"]'),
    ".h5": ("h5py", 'h5py.File(f)["NAME"][:]'),
    ".hdf5": ("h5py", 'h5py.File(f)["NAME"][:]'),
}
FRAMES_FIRST = "; NAME: of the variable; an array of all frames needs the axis of the frames first"


def conversion(path: Path, ending: str = "") -> str:
    """The end of a message on a file, or on the files of a folder with this ending; empty for another container."""
    ending = ending or path.suffix.lower()
    if ending == ".json":
        return (
            "; outlines of an annotation program are not read: for masks, let it export one picture per frame (COCO in"
            " Python: pycocotools, COCO(FILE).annToMask(ANNOTATION))"
        )
    if ending not in LOADS:
        return ""
    package, load = LOADS[ending]
    files = f"glob.glob({_text(path / f'*{ending}')})" if path.is_dir() else f"[{_text(path)}]"
    line = f'import glob, numpy, {package}; [numpy.save(f + ".npy", numpy.asarray({load})) for f in {files}]'
    return f"; {ending} is not read here; in Python: `{line}` converts it{FRAMES_FIRST * ('NAME' in load)}"


def calibration_conversion(path: Path) -> str:
    """As `conversion`, for a calibration: its matrix and its distortion."""
    ending = path.suffix.lower()
    if ending not in LOADS or ending == ".mat":
        return ""
    package, load = LOADS[ending]
    line = f"import numpy, {package}; f = {_text(path)}; found = {load}; numpy.savez(f + '.npz', mtx=..., dist=...)"
    return f"; {ending} is not read here; in Python: `{line}` converts it, with the camera matrix and the distortion"


def stack_conversion(path: Path, name: str) -> str:
    """The line for a MAT-file with an array (height, width, frames) of this name."""
    load = f"scipy.io.loadmat({_text(path)})[{json.dumps(name)}]"
    return f"import numpy, scipy.io; numpy.save({_text(path.with_suffix('.npy'))}, numpy.moveaxis({load}, 2, 0))"


def _text(path: Path) -> str:
    return json.dumps(str(path), ensure_ascii=False)
