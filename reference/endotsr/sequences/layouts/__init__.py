"""The layouts in which recordings come, one file each.

A file of this folder holds one value `LAYOUT`; putting it here registers it. `detect` asks the layouts in the order of
`rank`: those that state what they are first, a plain folder of pictures last.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.sequences.calibration_formats import HALF_A_PIXEL
from endotsr.sequences.recording import Recording, StatedDepth
from endotsr.sequences.sequence import Sequence
from endotsr.sequences.source_options import SourceOptions
from endotsr.sequences.sources import depth_step, masks_are_proposed

# What a user may state of a source and only some layouts read; the others follow from these.
STATEMENTS = (
    "stereo", "camera", "distortion", "calibration", "baseline", "trajectory", "masks", "depth", "orientation",
)  # fmt: skip


class Layout(NamedTuple):
    """One layout on disk."""

    name: str
    about: str  # what a path in this layout holds, for messages
    rank: int  # layouts are tried in ascending order
    recognises: Callable[[Path], bool]
    open: Callable[[Path, SourceOptions], Recording]
    takes: tuple[str, ...] = ()  # of STATEMENTS: what it reads; anything else that is stated is refused
    read: Callable[[Path, SequenceConfig, float], Sequence] | None = None  # None: `endotsr prepare` comes first
    hashes: Callable[[Path, SequenceConfig], dict[str, str]] | None = None  # of the files that `read` reads


@cache
def layouts() -> tuple[Layout, ...]:
    """Every layout, in the order in which they are tried."""
    found = [import_module(f"{__name__}.{entry.name}").LAYOUT for entry in iter_modules(__path__)]
    return tuple(sorted(found, key=lambda layout: (layout.rank, layout.name)))


def layout_of(path: Path, name: str = "auto") -> Layout:
    """The layout named, or the first that recognises the path.

    Raises:  InputError if the path does not exist or no layout recognises it, with what would be recognised.
    """
    path = Path(path)
    if name != "auto":
        found = {layout.name: layout for layout in layouts()}
        if name not in found:
            raise InputError(f"layout {name!r} is not allowed; allowed: auto, {', '.join(found)}")
        return found[name]
    if not path.exists():
        raise InputError(f"{path}: not found")
    for layout in layouts():
        if layout.recognises(path):
            return layout
    known = "; ".join(f"{layout.name} ({layout.about})" for layout in layouts())
    raise InputError(f"{path}: no known layout; allowed: {known}")


def open_recording(path: Path, options: SourceOptions) -> Recording:
    """The recording at a path. Raises InputError."""
    layout = layout_of(path, options.layout)
    if options.layout != "auto" and not Path(path).exists():
        raise InputError(f"{path}: not found")
    refuse_unused(layout, Path(path), options)
    recording = layout.open(Path(path), options)
    if options.calibration is not None:
        said = f"{options.calibration.name}: {HALF_A_PIXEL}"
        recording = replace(recording, notes=[*recording.notes, said])
    if options.depth is not None:
        stated = StatedDepth(options.depth, depth_step(options), options.trust_depth)
        recording = replace(recording, stated_depth=stated)
    return replace(recording, proposed=True) if masks_are_proposed(options) else recording


def refuse_unused(layout: Layout, path: Path, options: SourceOptions) -> None:
    """Raises InputError for a statement that this layout does not read: its own files say so, or nothing can."""
    defaults = SourceOptions()
    for name in STATEMENTS:
        if getattr(options, name) != getattr(defaults, name) and name not in layout.takes:
            taken = ", ".join(f"--{word}" for word in layout.takes) or "none of these"
            raise InputError(f"{path}: the layout {layout.name} does not read --{name}; allowed: {taken}")


def read_sequence(path: Path, config: SequenceConfig, near: float) -> Sequence:
    """The sequence at a path, in any layout that can be trained on as it is.

    Raises:  InputError; for another layout it names the commands that make a sequence of it.
    """
    layout = readable_layout(Path(path))
    assert layout.read is not None
    return layout.read(Path(path), config, near)


def readable_layout(path: Path) -> Layout:
    """The layout of a path that can be trained on as it is; a path that is in no layout is read as EndoNeRF.

    Raises:  InputError for a layout that needs `endotsr prepare`.
    """
    found = next((layout for layout in layouts() if path.exists() and layout.recognises(path)), None)
    if found is None or (found.name == "pictures" and (path / "depth").is_dir()):
        found = layout_of(path, "endonerf")  # its messages say what is missing
    if found.read is None:
        raise InputError(f"{path}: {found.about}; `endotsr prepare {path} --out FOLDER` makes a sequence of it")
    return found
