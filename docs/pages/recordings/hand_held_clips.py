"""Clips with a hand-held camera: simulated ones with true poses, and two recordings."""

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from endotsr.clips.sequences.sequence import Sequence
from endotsr.config import with_settings
from pages.store.commands import said

if TYPE_CHECKING:
    from endotsr.clips.simulator.simulate import SimulatedSequence

SMALL, LARGE = (320, 256), (640, 512)
FRAMES, SHIFT, CYCLES = 48, 8.0, 2.0  # largest sideways shift in mm, and the rate of the path of the hand
SEEN = ("camera_motion", "motion_blur", "vignetting", "second_light", "highlights", "noise", "depth_rounding")
TISSUE = ("breathing", "pulsation")
KINDS: dict[str, tuple[str, ...]] = {
    "rigid": (),
    "breathing": TISSUE,
    "breathing, pull, instrument": (*TISSUE, "pull", "instrument"),
    "rigid, jumps of the exposure": ("auto_exposure", "exposure"),
}


@lru_cache(maxsize=1)
def simulated(
    kind: str, size: tuple[int, int], seed: int, frames: int = FRAMES, shift: float = SHIFT, cycles: float = CYCLES
) -> Sequence:
    """A simulated hand-held clip with true poses."""
    return with_truth(kind, size, seed, frames, shift, cycles).sequence


def with_truth(
    kind: str, size: tuple[int, int], seed: int, frames: int = FRAMES, shift: float = SHIFT, cycles: float = CYCLES
) -> "SimulatedSequence":
    """The same clip with the true motion of its tissue."""
    from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
    from endotsr.clips.simulator.simulate import simulate

    plain = SimulatorSettings(width=size[0], height=size[1], frames=frames, seed=seed)
    settings = with_effects(plain, *SEEN, *KINDS[kind])
    path = {"path": "hand", "amplitude": shift, "cycles": cycles}
    return simulate(with_settings(settings, camera_motion=path))


@lru_cache(maxsize=1)
def recorded(name: str, data: Path, scale: str = "0.16667") -> Sequence:
    """A real clip, prepared from its original files, `sinus_endoscopy` at a scale.

    Raises: InputError if a command fails.
    """
    import endotsr

    with tempfile.TemporaryDirectory() as root:
        clip = Path(root) / "clip"
        if name == "sinus_endoscopy":
            said("prepare", data / name, "--out", clip, "--scale", scale)
        else:
            stereo = ("--stereo", "side_by_side", "--calibration", data / name / "calibration.yaml")
            said("prepare", data / name / "video.mp4", *stereo, "--out", clip, "--scale", "0.25")
            said("depth", clip)
        return endotsr.load_sequence(clip, allow_tissue_fraction=True, depth_percentiles=(0.0, 100.0))
