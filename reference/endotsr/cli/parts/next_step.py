"""The last line of `prepare`, `depth` and `poses`: the command that comes next."""

import shlex
from pathlib import Path

from endotsr.clips.sequences.sequence_file import SequenceFile
from endotsr.clips.sequences.smaller import LEAST_SIDE
from endotsr.clips.sequences.splits import LEAST_FRAMES
from endotsr.untrusted.names import counted


def training_step(folder: Path, file: SequenceFile) -> str:
    """The training of a prepared folder, or why there is none."""
    return obstacle(file) or f"next: endotsr train {shlex.quote(str(folder))} --out RUN"


def obstacle(file: SequenceFile) -> str:
    """Why the size of a clip permits no training, as `check` refuses it; "" if it permits one."""
    camera = file.camera
    if file.frames < LEAST_FRAMES:
        return (
            f"no training: it needs at least {LEAST_FRAMES} frames, and the clip has {counted(file.frames, 'frame')};"
            " prepare more frames of its source"
        )
    if min(camera.width, camera.height) < LEAST_SIDE:
        return (
            f"no training: it needs at least {LEAST_SIDE} pixels on each side, and the pictures have"
            f" {camera.width}x{camera.height}; prepare larger ones"
        )
    return ""
