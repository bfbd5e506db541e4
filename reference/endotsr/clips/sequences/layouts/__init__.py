"""The layouts of recordings, one file each.

Every file in this folder defines a value `LAYOUT` and is registered automatically. `layout_of` tries the layouts in the
order of `rank`: unambiguous ones first, a plain folder of pictures last.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from endotsr.clips.sequences.calibration_formats import HALF_A_PIXEL
from endotsr.clips.sequences.clip import Clip, StatedDepth
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import depth_step, masks_are_proposed
from endotsr.config import SequenceConfig
from endotsr.errors import InputError

# Statements of a user that only some layouts read; the other options depend on these.
STATEMENTS = (
    "stereo", "camera", "distortion", "calibration", "baseline", "trajectory", "masks", "depth", "orientation",
)  # fmt: skip


class Layout(NamedTuple):
    """One layout on disk."""

    name: str
    about: str  # contents of a path in this layout, for messages
    rank: int  # layouts are tried in ascending order
    recognises: Callable[[Path], bool]
    open: Callable[[Path, SourceOptions], Clip]
    takes: tuple[str, ...] = ()  # the STATEMENTS that it reads; the others are refused
    read: Callable[[Path, SequenceConfig, float], Sequence] | None = None  # None: needs `endotsr prepare`
    hashes: Callable[[Path, SequenceConfig], dict[str, str]] | None = None  # SHA-256 of the files that `read` reads


@cache
def layouts() -> tuple[Layout, ...]:
    """All layouts, in the order in which they are tried."""
    found = [import_module(f"{__name__}.{entry.name}").LAYOUT for entry in iter_modules(__path__)]
    return tuple(sorted(found, key=lambda layout: (layout.rank, layout.name)))


def layout_of(path: Path, name: str = "auto") -> Layout:
    """The layout named, or the first that recognises the path.

    Raises:  InputError for an unknown name, a missing path, or a path that no layout recognises, listing the layouts.
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


def describe(path: Path, options: SourceOptions) -> Clip:
    """The clip at a path. Raises InputError."""
    layout = layout_of(path, options.layout)
    if options.layout != "auto" and not Path(path).exists():
        raise InputError(f"{path}: not found")
    refuse_unused(layout, Path(path), options)
    clip = layout.open(Path(path), options)
    if options.calibration is not None:
        said = f"{options.calibration.name}: {HALF_A_PIXEL}"
        clip = replace(clip, notes=[*clip.notes, said])
    if options.depth is not None:
        stated = StatedDepth(options.depth, depth_step(options), options.trust_depth)
        clip = replace(clip, stated_depth=stated)
    return replace(clip, proposed=True) if masks_are_proposed(options) else clip


def refuse_unused(layout: Layout, path: Path, options: SourceOptions) -> None:
    """Raises InputError for a statement that this layout does not read."""
    defaults = SourceOptions()
    for name in STATEMENTS:
        if getattr(options, name) != getattr(defaults, name) and name not in layout.takes:
            taken = ", ".join(f"--{word}" for word in layout.takes) or "none of these"
            raise InputError(f"{path}: the layout {layout.name} does not read --{name}; allowed: {taken}")


def read_sequence(path: Path, config: SequenceConfig, near: float) -> Sequence:
    """The sequence at a path, in a layout that training reads directly.

    Raises:  InputError; for another layout, with the command that converts it.
    """
    layout = readable_layout(Path(path))
    assert layout.read is not None
    return layout.read(Path(path), config, near)


def readable_layout(path: Path) -> Layout:
    """The layout of a path that training reads directly. A path in no known layout is read as EndoNeRF.

    Raises:  InputError for a layout that needs `endotsr prepare`.
    """
    found = next((layout for layout in layouts() if path.exists() and layout.recognises(path)), None)
    if found is None or (found.name == "pictures" and (path / "depth").is_dir()):
        found = layout_of(path, "endonerf")  # its messages name the missing parts
    if found.read is None:
        raise InputError(f"{path}: {found.about}; `endotsr prepare {path} --out FOLDER` converts it")
    return found
