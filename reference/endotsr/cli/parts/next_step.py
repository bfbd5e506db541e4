"""The last line of `prepare`, `depth` and `poses`: the command that comes next."""

import shlex
from pathlib import Path

from endotsr.clips.sequences.sequence_file import SequenceFile
from endotsr.clips.sequences.smaller import too_small
from endotsr.clips.sequences.splits import too_few


def training_step(folder: Path, file: SequenceFile) -> str:
    """The training of a prepared folder, or why there is none."""
    return obstacle(file) or f"next: endotsr train {shlex.quote(str(folder))} --out RUN"


def obstacle(file: SequenceFile) -> str:
    """Why the size of a clip permits no training, in the words of `check` and `train`; "" if it permits one."""
    if few := too_few(file.frames):
        return f"no training: {few}; prepare more frames of its source"
    small = too_small(file.camera.width, file.camera.height)
    return f"no training: {small}; prepare larger ones" if small else ""
