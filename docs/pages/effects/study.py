"""Reliability of the tests: simulated clips with known effects, several seeds, a sweep of amplitudes.

In: seeds and a number of frames. Out: one JSON-serialisable answer per clip (`answer_of`), with which an interrupted
study continues; and their summary (`summary`): detections and false positives of each effect, and the detection rate
of each amplitude, in the unit of the effect (px, percent, degrees, mm).

Thresholds were tuned on seeds below `FIRST_SEED`; a study uses the seeds from there on.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from endotsr.clips.effects.inspect import EFFECTS, Inspection, inspect_sequence
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.settings import SimulatorSettings, with_effects
from endotsr.clips.simulator.simulate import SimulatedSequence, simulate
from endotsr.config import with_settings

FIRST_SEED = 200
FOUND = (*EFFECTS, "periodic motion")
MOTIONS = ("breathing", "pulsation", "pull")
LIGHTS = ("exposure", "brightening")
BEATING = {"breathing": {"cycles": 4.0}}  # breaths that a clip can hold often enough to call them periodic
SWEEPS: dict[str, tuple[float, ...]] = {
    "breathing": (0.05, 0.1, 0.2, 0.4, 2.5),
    "pulsation": (0.05, 0.1, 0.2, 0.4, 0.7),
    "pull": (0.1, 0.2, 0.4, 0.8, 5.0),
    "exposure": (0.005, 0.01, 0.02, 0.05, 0.15),
    "brightening": (0.02, 0.05, 0.1, 0.2, 0.6),
    "highlights": (0.25, 0.5, 1.0, 2.0),
    "camera_motion": (0.001, 0.1, 1.0, 3.0, 9.0),
    "depth_errors": (0.02, 0.05, 0.1, 0.5),
    "cutting": (0.25, 0.5, 1.0, 2.0, 4.0),
}
STRENGTH = {"highlights": "strength", "depth_errors": "sigma", "cutting": "opening"}
"""The swept setting; otherwise `amplitude`."""
MIXTURES = (
    ("noise", "breathing", "pulsation", "instrument", "highlights"),
    ("noise", "pull", "exposure", "instrument"),
    ("noise", "pulsation", "exposure", "brightening", "highlights", "depth_errors"),
    ("noise", "breathing", "pulsation", "pull", "exposure", "brightening", "highlights", "instrument", "camera_motion"),
)
BLUR_FRAMES, SMOKE_FRAMES = 3, 6  # frames in the middle of the clip
SPOILED = {"blur": (0.5, 1.0, 2.0), "smoke": (0.05, 0.1, 0.2, 0.4)}  # pixels, fraction of grey


class Trial(NamedTuple):
    """One clip of the study."""

    seed: int
    scene: str  # names of the effects
    swept: str  # effect whose amplitude is swept, or ""
    amplitude: float
    expected: dict[str, bool | None]  # by effect; None = neither answer is wrong

    @property
    def key(self) -> str:
        """Unique among the clips of a study of a given length."""
        return f"{self.seed}: {self.scene} {self.amplitude:g}"

    @property
    def strongest(self) -> bool:
        """Whether the amplitude is the largest of its sweep, or none is swept."""
        return not self.swept or self.amplitude == max((SWEEPS | SPOILED)[self.swept])


def settings_of(names: tuple[str, ...], seed: int, frames: int, amplitude: float | None = None) -> SimulatorSettings:
    """Settings with the named effects; the last one has the amplitude, if one is given."""
    settings = with_effects(SimulatorSettings(frames=frames, seed=seed), *names)
    changes = {name: dict(BEATING.get(name, {})) for name in names}
    if amplitude is not None:
        changes[names[-1]][STRENGTH.get(names[-1], "amplitude")] = amplitude
    return with_settings(settings, **changes)


def expectation(names: tuple[str, ...]) -> dict[str, bool | None]:
    """The correct answers of the tests on a clip with these effects.

    Tissue that moves under the lamp, and a lamp that moves with the camera, do change the light: such clips are
    excluded. Changes of the view are excluded as well, because they are gradual. A slit moves the nearby tissue once.
    """
    on = set(names)
    moves = bool(on & {*MOTIONS, "cutting"})
    light: bool | None = bool(on & set(LIGHTS)) or (None if moves or "camera_motion" in on else False)
    return {
        "motion": moves,
        "periodic motion": _beats(on),
        "photometric": light,
        "highlights": "highlights" in on,
        "occluders": "instrument" in on,
        "camera motion": "camera_motion" in on,
        "view change": None if "camera_motion" in on else False,
        "depth quality": "depth_errors" in on,
        "topology change": "cutting" in on,
        "smoke": False,
        "blur": False,
    }


def _beats(on: set[str]) -> bool | None:
    """Whether a rate is expected; None with a pull or a moving camera, which may hide a beat."""
    beats = bool(on & {"breathing", "pulsation"})
    return None if beats and on & {"pull", "camera_motion"} else beats


def trials(seeds: Iterable[int]) -> Iterator[Trial]:
    """All clips of the study, in order; nothing is simulated yet."""
    for seed in seeds:
        for names in (("noise",), ("noise", "instrument"), *MIXTURES):
            yield Trial(seed, " + ".join(names), "", 0.0, expectation(names))
        for effect, amplitudes in SWEEPS.items():
            for amplitude in amplitudes:
                yield Trial(seed, effect, effect, amplitude, expectation(("noise", effect)))
        for effect, amplitudes in SPOILED.items():
            for amplitude in amplitudes:
                expected = expectation(("noise",)) | {effect: True, "photometric": None}
                yield Trial(seed, effect, effect, amplitude, expected)


def clip_of(trial: Trial, frames: int) -> tuple[Sequence, float]:
    """The clip of a trial, and the size of the swept effect in the unit of the table (0 without a sweep)."""
    if trial.swept in SPOILED:
        still = simulate(settings_of(("noise",), trial.seed, frames)).sequence
        spoil = {"blur": blurred, "smoke": smoky}[trial.swept]
        return spoil(still, trial.amplitude), trial.amplitude
    if not trial.swept:
        return simulate(settings_of(tuple(trial.scene.split(" + ")), trial.seed, frames)).sequence, 0.0
    made = simulate(settings_of(("noise", trial.swept), trial.seed, frames, trial.amplitude))
    return made.sequence, size_of(trial.swept, trial.amplitude, made)


def size_of(effect: str, amplitude: float, made: SimulatedSequence) -> float:
    """The observable amplitude: px of the largest flow (RMS over time), percent, degrees, mm."""
    if effect in MOTIONS:
        sequence = made.sequence
        middle = int(sequence.train_index[len(sequence.train_index) // 2])
        flows = [made.true_flow(middle, int(i)) for i in sequence.train_index]
        return float(np.sqrt(np.mean([(flow**2).sum(axis=0) for flow in flows], axis=0)).max())
    if effect == "camera_motion":
        return float(np.degrees(np.arctan(amplitude / made.settings.distance)))
    return amplitude if effect in STRENGTH else 100.0 * amplitude


UNITS = {
    **dict.fromkeys(MOTIONS, "px"), "exposure": "percent", "brightening": "percent", "highlights": "strength",
    "camera_motion": "degrees", "depth_errors": "mm", "cutting": "mm", "blur": "px", "smoke": "of full density",
}  # fmt: skip
ANSWERS = {
    **dict.fromkeys(MOTIONS, "motion"), **dict.fromkeys(LIGHTS, "photometric"), "highlights": "highlights",
    "camera_motion": "camera motion", "depth_errors": "depth quality", "cutting": "topology change",
    "blur": "blur", "smoke": "smoke",
}  # fmt: skip


def blurred(sequence: Sequence, sigma: float) -> Sequence:
    """The sequence with a Gaussian blur of `sigma` pixels in three training frames of the middle."""
    from scipy.ndimage import gaussian_filter

    return _spoiled(
        sequence, BLUR_FRAMES, lambda picture: gaussian_filter(picture.astype(np.float64), (0.0, sigma, sigma))
    )


def smoky(sequence: Sequence, density: float) -> Sequence:
    """The sequence with grey smoke of this density over six training frames of the middle."""
    return _spoiled(sequence, SMOKE_FRAMES, lambda picture: (1 - density) * picture + density * 190.0)


def _spoiled(sequence: Sequence, count: int, change: Callable[[np.ndarray], np.ndarray]) -> Sequence:
    import dataclasses

    images = sequence.images.copy()
    first = (len(sequence.train_index) - count) // 2
    for i in sequence.train_index[first : first + count]:
        images[i] = np.rint(change(images[i])).astype(np.uint8)
    return dataclasses.replace(sequence, images=images)


def answers(inspection: Inspection) -> dict[str, bool]:
    """The answers of the tests, by effect."""
    said = {name: verdict.present for name, verdict in inspection.verdicts.items()}
    return said | {"periodic motion": bool(inspection.lines)}


def answer_of(trial: Trial, frames: int) -> dict[str, Any]:
    """The answers of the tests on a clip, JSON-serialisable: "key", "size", "noise" and "said" {effect: found}."""
    sequence, size = clip_of(trial, frames)
    inspection = inspect_sequence(sequence)
    return {"key": trial.key, "size": size, "noise": inspection.noise.level, "said": answers(inspection)}


def wrong(trial: Trial, said: dict[str, bool]) -> list[str]:
    """The effects with an unexpected answer."""
    return [name for name, expected in trial.expected.items() if expected is not None and said[name] != expected]


def summary(seeds: range, frames: int, found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts over the answers of all trials of these seeds, by key. Raises: KeyError if one is missing.

    returns  JSON-able: "effects" {name: positives, detected, negatives, false}, "sweeps" {effect: rows}, and the sizes
    """
    counts = {name: {"positives": 0, "detected": 0, "negatives": 0, "false": 0} for name in FOUND}
    sweeps: dict[str, dict[float, list[Any]]] = {name: {} for name in ANSWERS}
    noise = []
    for trial in trials(seeds):
        answer = found[trial.key]
        said = answer["said"]
        for name, expected in trial.expected.items():
            counts[name]["negatives"] += expected is False
            counts[name]["false"] += expected is False and said[name]
            counts[name]["positives"] += expected is True and trial.strongest
            counts[name]["detected"] += expected is True and trial.strongest and said[name]
        if trial.swept:
            row = sweeps[trial.swept].setdefault(trial.amplitude, [])
            row.append((answer["size"], said[ANSWERS[trial.swept]]))
        noise.append(answer["noise"])
    swept = {name: [_row(amplitude, rows) for amplitude, rows in all_.items()] for name, all_ in sweeps.items()}
    return {
        "seeds": len(seeds), "first_seed": seeds.start, "frames": frames, "clips": len(noise),
        "noise": float(np.median(noise)), "effects": counts, "sweeps": swept,
    }  # fmt: skip


def _row(amplitude: float, rows: list[Any]) -> dict[str, Any]:
    """One amplitude of a sweep, over the seeds."""
    return {
        "amplitude": amplitude,
        "size": float(np.median([size for size, _ in rows])),
        "detected": sum(bool(found) for _, found in rows),
        "clips": len(rows),
    }
