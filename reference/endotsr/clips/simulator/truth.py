"""Writing and reading the truth of a simulated scene: the folder `truth` inside a sequence folder.

    truth.json          format, scene, unit, and the settings, from which all of this can be made again
    light.npz           times (n,); gain (n, 3) of the camera in linear light; its Fourier content over cycles (K,):
                        gain_cosine and gain_sine (K, 3); noise_sigma (), display units
    tracks.npz          material (2, P), position (n, 3, P), pixel (n, 2, P), depth (n, P), visible (n, P) as in
                        `MaterialTracks`; light (n, 3, P), linear light of the tissue there as `folder.tissue_light`:
                        without highlights, shadows, smoke, vignetting, motion blur and gain
    frames/000000.npz   float32: depth (H, W) mm; material (2, H, W) mm, NaN in the wound of a slit; highlight (H, W)
    instrument/*.png    255 = an instrument covers the pixel, margin not included

Lengths are in mm, image positions in px with the first pixel centre at (0.5, 0.5). The files are user input:
`read_truth` checks them and raises an `InputError` that names file and key.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import TRUTH
from endotsr.clips.simulator.frames import SimulatedFrame, SimulatedScene
from endotsr.clips.simulator.gain import GainSpectrum, gain_series, gain_spectrum
from endotsr.clips.simulator.scenes import effects_on
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.trajectories import MaterialTracks
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import BoolArray, FloatArray
from endotsr.untrusted.arrays import read_npz
from endotsr.untrusted.json import read_json
from endotsr.untrusted.names import shown
from endotsr.untrusted.sections import checked

FORMAT = 1
LARGEST_FILE = 1 << 31  # bytes, of the arrays together as well
MAY_BE_NAN = ("pixel", "position", "material")


class FrameTruth(NamedTuple):
    """The truth of one frame."""

    depth: NDArray[np.float32]  # (H, W)    view-space z of the tissue, mm, including tissue hidden by an instrument
    material: NDArray[np.float32]  # (2, H, W) material coordinates at the pixel centre, mm; NaN in the wound of a slit
    highlight: NDArray[np.float32]  # (H, W)    linear light of the highlights on the tissue; 0 if they are off
    instrument: BoolArray  # (H, W)    pixels covered by an instrument


@dataclass(frozen=True, eq=False)
class SceneTruth:
    """The truth of a scene. `frame` reads one frame at a time."""

    folder: Path
    scene: str  # the name that was asked for, or the list of effects
    settings: SimulatorSettings
    times: FloatArray  # (n,)
    gain: FloatArray  # (n, 3) linear light
    spectrum: GainSpectrum
    noise_sigma: float  # display units
    tracks: MaterialTracks
    light: FloatArray  # (n, 3, P) linear light of the tissue at the tracks

    def frame(self, i: int) -> FrameTruth:
        """The truth of frame i. Raises IndexError outside 0 .. n-1, and InputError for a damaged file."""
        if not 0 <= i < self.settings.frames:
            raise IndexError(f"frame {i} of a scene of {self.settings.frames}")
        from endotsr.clips.opencv.png import read_png

        size = (self.settings.height, self.settings.width)
        shapes = {"depth": size, "material": (2, *size), "highlight": size}
        found = _arrays(self.folder / "frames" / f"{i:06d}.npz", shapes)
        picture = self.folder / "instrument" / f"{i:06d}.png"
        pixels = read_png(picture)
        if pixels.shape != size or not np.isin(pixels, (0, 255)).all():
            raise InputError(f"{picture}: use a picture of {size[1]}x{size[0]} pixels with the values 0 and 255")
        return FrameTruth(found["depth"], found["material"], found["highlight"], pixels == 255)


def write_frame(folder: Path, i: int, frame: SimulatedFrame) -> None:
    """Write the truth of one frame. The folders `frames` and `instrument` must exist."""
    from endotsr.clips.opencv.png import write_png

    highlight = np.zeros(frame.depth.shape) if frame.highlight is None else frame.highlight
    np.savez(
        folder / "frames" / f"{i:06d}.npz",
        depth=frame.depth.astype(np.float32),
        material=frame.material.astype(np.float32),
        highlight=highlight.astype(np.float32),
    )
    write_png(folder / "instrument" / f"{i:06d}.png", np.where(frame.covered, 255, 0).astype(np.uint8))


def write_scene(folder: Path, scene: SimulatedScene, name: str, tracks: MaterialTracks, light: FloatArray) -> None:
    """Write the truth that is not specific to a frame."""
    settings = scene.settings
    gain = gain_series(settings, scene.times)
    spectrum = gain_spectrum(gain)
    np.savez(
        folder / "light.npz",
        times=scene.times,
        gain=gain,
        cycles=spectrum.cycles,
        gain_cosine=spectrum.cosine,
        gain_sine=spectrum.sine,
        noise_sigma=np.array(noise_sigma(settings)),
    )
    np.savez(folder / "tracks.npz", light=light, **tracks._asdict())
    record = {"format": FORMAT, "scene": name, "unit": "mm", "effects": effects_on(settings), "settings": settings}
    text = json.dumps(msgspec.to_builtins(record), indent=2) + "\n"
    (folder / "truth.json").write_text(text, encoding="utf-8", newline="\n")


def noise_sigma(settings: SimulatorSettings) -> float:
    """Standard deviation of the sensor noise, display units, without the rounding to 8 bits."""
    return settings.noise.sigma if settings.noise.on else 0.0


def read_truth(sequence: Path) -> SceneTruth:
    """The truth of a sequence folder written by `endotsr simulate`.

    Raises:  InputError without truth, or if a file is missing, damaged or inconsistent with the others.
    """
    folder = Path(sequence) / TRUTH
    name, settings = _record(folder / "truth.json")
    n, cycles = settings.frames, settings.frames // 2 + 1
    spectrum = {"cycles": (cycles,), "gain_cosine": (cycles, 3), "gain_sine": (cycles, 3)}
    light = _arrays(folder / "light.npz", {"times": (n,), "gain": (n, 3), "noise_sigma": (), **spectrum})
    points = "P"
    shapes = {"material": (2, points), "position": (n, 3, points), "pixel": (n, 2, points), "depth": (n, points)}
    found = _arrays(folder / "tracks.npz", {**shapes, "light": (n, 3, points), "visible": (n, points)})
    return SceneTruth(
        folder, name, settings, light["times"], light["gain"],
        GainSpectrum(light["cycles"], light["gain_cosine"], light["gain_sine"]), float(light["noise_sigma"]),
        MaterialTracks(**{key: found[key] for key in MaterialTracks._fields}), found["light"],
    )  # fmt: skip


def _record(path: Path) -> tuple[str, SimulatorSettings]:
    """Name and settings of truth.json."""
    if not path.is_file():
        raise InputError(f"{path}: file not found; use a sequence folder that `endotsr simulate` wrote")
    data = read_json(path)
    if data.get("format") != FORMAT:
        raise InputError(f"{path}: format = {shown(data.get('format'))} is not allowed; use {FORMAT}")
    settings = data.get("settings")
    if not isinstance(settings, dict):
        raise InputError(f"{path}: settings is missing; use the settings that `endotsr simulate` wrote")
    return str(data.get("scene", "")), checked(settings, SimulatorSettings, str(path), "settings.")


def _arrays(path: Path, shapes: dict[str, tuple[Any, ...]]) -> dict[str, Any]:
    """The arrays of a file, checked for names, shapes, types and finite values. "P" is an arbitrary common length."""
    found = read_npz(path, shapes, LARGEST_FILE)
    free: int | None = None
    for name, expected in shapes.items():
        if name not in found:
            raise InputError(f"{path}: {name} is missing; the file needs {', '.join(shapes)}")
        array = found[name]
        if free is None and "P" in expected and array.ndim == len(expected):
            free = array.shape[expected.index("P")]
        shape = tuple(free if length == "P" else length for length in expected)
        kind = "b" if name == "visible" else "f"
        if array.shape != shape or array.dtype.kind != kind:
            wanted = "true or false" if kind == "b" else "real numbers"
            raise InputError(f"{path}: {name} is {array.dtype} of shape {array.shape}; use {wanted}, {shape}")
        if kind == "f" and (np.isinf(array).any() or (name not in MAY_BE_NAN and np.isnan(array).any())):
            raise InputError(f"{path}: {name} holds a number that is not finite; use finite numbers")
    return found
