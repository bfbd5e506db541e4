"""What a path without a run is, with the command that makes a run of it, or the run that is meant.

In: a path that is no run folder. Out: the end of a refusal.
"""

import shlex
from pathlib import Path

from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.layouts import layout_of
from endotsr.clips.sequences.record import RUN_FILES, is_run
from endotsr.errors import InputError
from endotsr.untrusted.names import plain_line

TRAIN = "`endotsr train {} --out RUN` makes a run of {}"


def why_no_run(path: Path) -> str:
    """Why a path is no run folder: what is there, and what to use."""
    if not path.exists():
        return "run folder not found"
    if of := next((folder for folder in (path.parent, path.parent.parent) if is_run(folder)), None):
        return f"not a run folder, but a part of one; use {of}"
    missing = RUN_FILES
    if path.is_dir():
        missing = [name for name in RUN_FILES if not (path / name).is_file()]
        if runs := sorted(plain_line(folder.name) for folder in path.iterdir() if is_run(folder)):
            return f"not a run folder; use one of those in it: {shortened(runs)}"
    clip = _of_clip(path) if len(missing) == len(RUN_FILES) else ""
    return clip or f"not a run folder: {missing[0]} is missing"


def _of_clip(path: Path) -> str:
    """What is said of a clip or of a recording in place of a run; empty for any other path."""
    try:
        layout = layout_of(path)
    except InputError:
        return ""
    shown = shlex.quote(str(path))  # as a shell takes it
    if layout.direct:
        return f"not a run folder, but a clip; {TRAIN.format(shown, 'it')}"
    prepared = f"`endotsr prepare {shown} --out CLIP` makes a clip of it"
    return f"not a run folder, but {layout.about}; {prepared}, and {TRAIN.format('CLIP', 'that')}"
