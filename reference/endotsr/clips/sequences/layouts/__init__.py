"""The layouts of recordings, one file each.

Every file in this folder defines a value `LAYOUT` and is registered automatically. `layout_of` tries the layouts in the
order of `rank`: unambiguous ones first, a plain folder of pictures last.
"""

import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from endotsr.clips.formats.calibration_formats import HALF_A_PIXEL
from endotsr.clips.formats.camera import ARBITRARY, MILLIMETRES
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS
from endotsr.clips.sequences.poses import POSE_FILES
from endotsr.clips.sequences.sequence_file import DEPTH, IMAGES, MASKS
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.clips.sequences.sources import MASK_ENDINGS
from endotsr.clips.sequences.unknown_source import not_there, what_it_is
from endotsr.clips.sequences.unread import folders_of, together, unread
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.untrusted.names import choice

# Statements of a user that only some layouts read; the other options depend on these.
STATEMENTS = (
    "stereo", "camera", "field_of_view", "distortion", "calibration", "baseline", "trajectory", "masks", "depth",
    "orientation",
)  # fmt: skip
NOTHING = SourceOptions()


class Layout(NamedTuple):
    """One layout on disk."""

    name: str
    about: str  # contents of a path in this layout, for messages
    rank: int  # layouts are tried in ascending order
    recognises: Callable[[Path], bool]
    describe: Callable[[Path, SourceOptions], Clip]
    takes: tuple[str, ...] = ()  # the STATEMENTS that it reads; the others are refused
    direct: bool = False  # training reads it directly; other layouts need `endotsr prepare`
    reads: tuple[str, ...] = ()  # patterns of names in its folder, in lower case, that it reads or that say nothing


@cache
def layouts() -> tuple[Layout, ...]:
    """All layouts, in the order in which they are tried."""
    found = [import_module(f"{__name__}.{entry.name}").LAYOUT for entry in iter_modules(__path__)]
    return tuple(sorted(found, key=lambda layout: (layout.rank, layout.name)))


PARTS_OF_ENDONERF = (IMAGES, DEPTH, MASKS, "gt_masks", *POSE_FILES)


def layout_of(path: Path, name: str = "auto") -> Layout:
    """The layout named, or the first that recognises the path.

    Raises:  InputError for an unknown name, a missing path, or a path that no layout recognises, listing the layouts.
    """
    path = Path(path)
    if name != "auto":
        found = {layout.name: layout for layout in layouts()}
        if name not in found:
            raise InputError(f"layout {name!r} is not allowed; use {choice(['auto', *found])}")
        return found[name]
    if not path.exists():
        raise InputError(f"{path}: {not_there(path)}")
    if not (path.is_file() or path.is_dir()):
        raise InputError(f"{path}: is neither a file nor a folder; use one of them")
    for layout in layouts():
        if layout.recognises(path):
            return layout
    if what := what_it_is(path):
        raise InputError(f"{path}: no known layout{what}")
    known = "; ".join(f"{layout.name} ({layout.about})" for layout in layouts())
    raise InputError(f"{path}: no known layout; use {known}")


def describe(path: Path, options: SourceOptions = NOTHING) -> Clip:
    """The clip at a path, with a note for every frame whose pose is unusable. Raises InputError."""
    path = Path(path)
    layout = layout_of(path, options.layout)
    if options.layout != "auto" and not path.exists():
        raise InputError(f"{path}: {not_there(path)}")
    refuse_unused(layout, path, options)
    clip = without_faults(layout.describe(path, options))
    _refuse_unknown_unit(clip, options)
    clip = _of_one_unit(clip, options)
    if clip.pose_faults and len(clip.pose_faults) == clip.count:
        raise InputError(next(iter(clip.pose_faults.values())))
    said = [*clip.notes, *clip.pose_faults.values()]
    inside = together(clip.inside, _stated_folders(options))
    said += unread(path, (*layout.reads, *clip.read_here), options, layout.takes, inside)
    if options.calibration is not None:
        said.append(f"{options.calibration.name}: {HALF_A_PIXEL}")
    return replace(clip, notes=said)


def _refuse_unknown_unit(clip: Clip, options: SourceOptions) -> None:
    """Raises InputError for an arbitrary unit beside lengths that the layout has in a known one."""
    wrong = _stated_arbitrary(options)
    if wrong and not clip.arbitrary:
        allowed = ", ".join(MILLIMETRES)
        raise InputError(
            f"{clip.where}: --{wrong}-unit arbitrary: the layout {clip.layout} has lengths in a known unit; use"
            f" one of {allowed}"
        )


def _stated_arbitrary(options: SourceOptions) -> str | None:
    """Which lengths are stated to have an arbitrary unit: `trajectory`, `depth` or none."""
    stated = {"trajectory": options.trajectory_unit, "depth": options.depth_unit}
    return next((name for name, unit in stated.items() if unit == ARBITRARY), None)


def _of_one_unit(clip: Clip, options: SourceOptions) -> Clip:
    """The clip; without the baseline that a file has beside the pictures of one camera, where the unit is arbitrary.

    A clip has one unit for poses, depth and baseline. A baseline is in millimetres, and so is the depth of its pair.

    Raises:  InputError for an arbitrary unit beside the baseline of a pair.
    """
    name = _stated_arbitrary(options)
    if name is None or clip.layout == "common" or not (clip.baseline or clip.calibration):
        return clip
    if options.baseline is None and clip.calibration is None and next(clip.pictures([0])).right is None:
        note = f"baseline of {clip.baseline:g} mm left out: the unit is arbitrary, and there are no right pictures"
        return replace(clip, baseline=None, notes=[*clip.notes, note])
    what, remedy = "depth", "; endotsr depth makes depth of the pair"
    if name == "trajectory":
        what, remedy = "positions", f" and --{name}; after endotsr depth, endotsr poses scales a path to its depth"
    raise InputError(
        f"{clip.where}: --{name}-unit arbitrary beside a baseline in millimetres: the {what} would have another scale"
        f" than the pair; use the unit of the {what}, or without --{name}-unit{remedy}"
    )


def _stated_folders(options: SourceOptions) -> dict[Path, tuple[str, ...]]:
    """The folders of stated files, see `unread`."""
    stated = ((options.right, PICTURE_ENDINGS), (options.masks, MASK_ENDINGS), (options.depth, DEPTH_ENDINGS))
    return together(*(folders_of([of / "*"], endings) for of, endings in stated if of is not None and of.is_dir()))


def without_faults(clip: Clip) -> Clip:
    """The clip. Raises InputError with the first of its faults."""
    for fault in clip.faults:
        raise InputError(fault.what)
    return clip


def refuse_unused(layout: Layout, path: Path, options: SourceOptions) -> None:
    """Raises InputError for a statement that this layout does not read."""
    for name in STATEMENTS:
        if getattr(options, name) != getattr(NOTHING, name) and name not in layout.takes:
            given, *taken = (f"--{word.replace('_', '-')}" for word in (name, *layout.takes))
            read = ", ".join(taken) or "none"
            raise InputError(
                f"{path}: the layout {layout.name} does not read {given}; of these options it reads {read}"
            )


def _instead_of(path: Path) -> str:
    """What to do in place of training on this folder: it is a part of a sequence, or needs `endotsr prepare`."""
    above = path.resolve().parent
    if path.is_dir() and any(layout.direct and layout.recognises(above) for layout in layouts()):
        return f"it is a part of the sequence {above}: use that folder"
    return f"`endotsr prepare {shlex.quote(str(path))} --out FOLDER` converts it"


def describe_for_training(path: Path, config: SequenceConfig) -> Clip:
    """The clip of a folder that training reads directly, with its faults and what it does not read.

    A folder in no known layout counts as EndoNeRF if it has a part of one.

    Raises:  InputError for a layout that needs `endotsr prepare`, and for a folder that cannot be described at all.
    """
    path = Path(path)
    found = next((layout for layout in layouts() if path.exists() and layout.recognises(path)), None)
    if found is None and path.is_dir() and not any((path / part).exists() for part in PARTS_OF_ENDONERF):
        raise InputError(
            f"{path}: no sequence{what_it_is(path)}; use a folder that `endotsr prepare SOURCE --out FOLDER`"
            " wrote, or one with images/, depth/, masks/ and poses_bounds.npy"
        )
    if found is None or (found.name == "pictures" and (path / "depth").is_dir()):
        found = layout_of(path, "endonerf")  # its messages name the missing parts
    if not found.direct:
        raise InputError(f"{path}: {found.about}; {_instead_of(path)}")
    clip = found.describe(path, SourceOptions(settings=config))
    if not clip.names and clip.faults:  # nothing is known of the folder, and so nothing of what is not read in it
        return clip
    left = unread(path, (*found.reads, *clip.read_here), NOTHING, found.takes, clip.inside)
    return replace(clip, not_read=tuple(left))
