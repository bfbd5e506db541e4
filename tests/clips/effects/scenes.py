"""Simulated clips with exactly the named effects, and what the tests of the package say of them."""

from functools import cache

from pages.effects.study import settings_of

from endotsr.clips.effects.inspect import Inspection, inspect_sequence
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.simulate import simulate

FRAMES = 24


@cache
def clip(*names: str, seed: int = 0, frames: int = FRAMES, amplitude: float | None = None) -> Sequence:
    """160x128 pixels; the last named effect has the amplitude."""
    return simulate(settings_of(names, seed, frames, amplitude)).sequence


@cache
def inspected(*names: str, seed: int = 0, frames: int = FRAMES, amplitude: float | None = None) -> Inspection:
    """The inspection of that clip."""
    return inspect_sequence(clip(*names, seed=seed, frames=frames, amplitude=amplitude))
