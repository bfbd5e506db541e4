"""Pairing of the files of another program with the frames of a clip.

Three ways: by the number in the names of the frames, by the number of each frame in the recording from which `prepare`
took it, or in order. Where two ways are possible and differ, the files are refused until an option selects one.

In: frames and files. Out: one file per frame or None, with a sentence where the way is not the first one.
"""

from pathlib import Path
from typing import Literal, NamedTuple, NoReturn

from endotsr.clips.formats.choices import Pairing
from endotsr.clips.formats.files import check_pairing, frame_numbers, shortened
from endotsr.clips.sequences.clip import Clip
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

WAYS = {
    "number": "the number in the name of each frame",
    "source": "the number of each frame in the recording from which the clip was prepared",
    "order": "the first file belongs to the first frame",
}


class Paired(NamedTuple):
    """Files of frames."""

    files: list[Path | None]  # one per frame; None: the frame has none
    note: str = ""  # what deserves a line: the way, and files of no frame


def paired(
    frames: list[Path] | int, files: list[Path], pairing: Pairing = "auto", source_names: list[str] | None = None
) -> Paired:
    """The file of each frame. A single file, such as a field of view, belongs to all frames.

    frames         files, or the count of a video, whose frames have the numbers 0 .. count - 1
    pairing        the way; auto: the one that gives every frame a file, or that uses every file
    source_names   of the frames in the recording from which they were prepared; None: the frames are the recording

    Edges:   without numbers, files are paired with frame files by name.
    Raises:  InputError if nothing matches, if two ways match and differ, or if frames and files are left over.
    """
    count = frames if isinstance(frames, int) else len(frames)
    if len(files) == 1:
        return Paired([files[0]] * count, "; ".join(of_no_or_all_frames(files, [files[0]] * count)))
    in_one_file = files[0].parent.is_file()  # planes of one array, which have an order and no names
    if pairing == "order" or (pairing == "auto" and in_one_file and len(files) == count):
        return _in_order(frames, files)
    found = {"number": _by_number(frames, files)}
    if source_names is not None:
        found["source"] = _by_number([Path(f"{name}.png") for name in source_names], files)
    elif pairing == "source":
        where = files[0].parent
        raise InputError(
            f"{where}: --pairing source, but the frames are not those of a prepared clip; use number or order"
        )
    way = _chosen(found, frames, files) if pairing == "auto" else pairing
    chosen = found[way]
    if chosen is None:
        _refuse_names(frames, files, _order_hint(count, files))
    notes = [f"{files[0].parent.name}: paired by {WAYS[way]}"] if way == "source" else []
    if in_one_file and len(files) < count and way == "number":
        notes.append(
            f"{files[0].parent.name}: its {len(files)} pictures belong to the first {len(files)} of {count} frames, one"
            " each; if it has another frame rate, write one picture per frame"
        )
    return Paired(chosen, "; ".join([*notes, *of_no_or_all_frames(files, chosen)]))


def of_no_or_all_frames(files: list[Path], chosen: list[Path | None]) -> list[str]:
    """A note on a single file that all frames share, or on files that belong to no frame.

    chosen   the file of each frame, of `paired` or `matching_files`
    """
    if len(files) == 1:
        return [f"{files[0].name}: taken for all {len(chosen)} frames"] if len(chosen) > 1 else []
    unused = [file.name for file in files if file not in set(chosen)]
    return [f"{files[0].parent.name}: belonging to no frame, not used: {shortened(unused)}"] if unused else []


def every_frame(clip: Clip, files: list[Path], pairing: Pairing = "auto") -> tuple[list[Path], str]:
    """The file of each frame of a clip, and the note, as `paired`. Raises InputError also for a frame without one."""
    found = paired(clip.images, files, pairing, clip.source_names)
    if lacking := [name for name, file in zip(clip.names, found.files) if file is None]:
        raise InputError(
            f"{files[0].parent}: has no file for frame {shortened(lacking)}; {counted(len(files), 'file')} for"
            f" {counted(clip.count, 'frame')}; use one file per frame"
        )
    return [file for file in found.files if file is not None], found.note


def matching_files(frames: list[Path] | int, files: list[Path]) -> list[Path | None]:
    """The file with the number of each frame, or None: `paired` by number, for the folders of a layout.

    Edges:   a single file matches all frames; without numbers, files are paired with frame files by name.
    Raises:  InputError if nothing matches. Files and frames may be left over; `of_no_or_all_frames` notes the files.
    """
    if len(files) == 1:
        return [files[0]] * (frames if isinstance(frames, int) else len(frames))
    found = _by_number(frames, files)
    if found is None:
        _refuse_names(frames, files)
    return found


def _in_order(frames: list[Path] | int, files: list[Path]) -> Paired:
    where, count = files[0].parent, frames if isinstance(frames, int) else len(frames)
    if len(files) != count:
        raise InputError(
            f"{where}: --pairing order: {counted(len(files), 'file')} for {counted(count, 'frame')}; use one per frame"
        )
    note = f"{where.name}: --pairing order pairs {files[0].name} with the first frame"
    return Paired(list(files), note + ("" if isinstance(frames, int) else _as_text(frames)))


def _as_text(frames: list[Path]) -> str:
    """The end of the note where the names of the frames, sorted as text, are in another order than by their numbers."""
    names = [frame.name for frame in frames]
    k = next((k for k, (one, other) in enumerate(zip(names, sorted(names))) if one != other), None)
    if k is None:
        return ""
    return (
        f"; sorted as text, {sorted(names)[k]} stands in the place of {names[k]}: a program that sorts so has stored"
        " another order, and needs names with leading zeros"
    )


def _by_number(frames: list[Path] | int, files: list[Path]) -> list[Path | None] | None:
    """The file with the number of each frame; None if the names have no comparable numbers, or no number matches."""
    numbers = frame_numbers(files)
    wanted = [(i,) for i in range(frames)] if isinstance(frames, int) else frame_numbers(frames)
    if wanted is None and numbers is None and not isinstance(frames, int):
        check_pairing(frames, files)
        return list(files)
    if wanted is None or numbers is None or len(wanted[0]) != len(numbers[0]):
        return None
    by_number = dict(zip(numbers, files))
    found = [by_number.get(number) for number in wanted]
    return found if any(found) else None


def _chosen(
    ways: dict[str, list[Path | None] | None], frames: list[Path] | int, files: list[Path]
) -> Literal["number", "source"]:
    """The way of `auto`. Raises InputError where none or several are possible."""
    possible = {way: found for way, found in ways.items() if found is not None}
    count = frames if isinstance(frames, int) else len(frames)
    if not possible:
        _refuse_names(frames, files, _order_hint(count, files))
    fits = {
        "every frame has a file": [way for way, found in possible.items() if all(found)],
        "every file has a frame": [way for way, found in possible.items() if set(files) <= set(found)],
    }
    for meaning, fitting in fits.items():
        if len(fitting) == 2 and possible["number"] != possible["source"]:
            said = " or ".join(f"--pairing {way} ({WAYS[way]})" for way in fitting)
            raise InputError(f"{files[0].parent}: {meaning} in two ways that differ; use {said}")
        if fitting:
            return "number" if "number" in fitting else "source"
    lines = [
        f"by {WAYS[way]}, {found.count(None)} of {count} frames have no file and {len(set(files) - set(found))} of"
        f" {counted(len(files), 'file')} no frame"
        for way, found in possible.items()
    ]
    others = [*possible, *(["order"] if len(files) == count else [])]
    raise InputError(
        f"{files[0].parent}: {'; '.join(lines)} ({files[0].name} to {files[-1].name}); use "
        + " or ".join(f"--pairing {way}" + (f" ({WAYS[way]})" if way == "order" else "") for way in others)
    )


def _order_hint(count: int, files: list[Path]) -> str:
    """The end of a refusal where the files could be paired in order."""
    return f"; use --pairing order ({WAYS['order']})" if len(files) == count else ""


def _refuse_names(frames: list[Path] | int, files: list[Path], hint: str = "") -> NoReturn:
    """Raises InputError for names that cannot be paired by number."""
    where, numbers = files[0].parent, frame_numbers(files)
    if isinstance(frames, int):
        if numbers is None or len(numbers[0]) != 1:
            raise InputError(f"{where}: names without one frame number, such as {files[0].name}{hint}")
        raise InputError(f"{where}: no file has a number from 0 to {frames - 1}, such as {files[0].name}{hint}")
    wanted = frame_numbers(frames)
    if wanted is None or numbers is None or len(wanted[0]) != len(numbers[0]):
        check_pairing(frames, files)
    raise InputError(f"{where}: no file has the number of a frame, such as {files[0].name} for {frames[0].name}{hint}")
