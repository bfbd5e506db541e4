"""What a folder loses when `prepare --replace` writes it again."""

from pathlib import Path

from endotsr.clips.sequences.sequence_file import FILE_NAME, SequenceFile, read_sequence_file
from endotsr.errors import InputError


def replaced_file(out: Path) -> SequenceFile | None:
    """The contents of `sequence.toml` in a folder that is about to be replaced; None without a readable one."""
    if not (Path(out) / FILE_NAME).is_file():
        return None
    try:
        return read_sequence_file(out)
    except InputError:
        return None


def lost_notes(before: SequenceFile | None, found: SequenceFile) -> list[str]:
    """A note for each of masks, depth and poses that the replaced folder had and the new one lacks."""
    if before is None:
        return []
    had = {
        "masks": before.masks and not found.masks and (before.masks.origin or "given"),
        "depth": before.depth and not found.depth and before.depth.method,
        "poses": before.poses and not found.poses and before.poses.origin,
    }
    return [
        f"the replaced folder had {what} ({origin}), this one has none; `endotsr {what}` makes new ones"
        for what, origin in had.items()
        if origin
    ]
