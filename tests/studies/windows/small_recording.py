"""A recording small enough for tests: 56 simulated frames of 48x40 pixels, and settings that train it in seconds."""

from pathlib import Path

import msgspec

from endotsr.clips.simulator.folder import write_sequence
from endotsr.clips.simulator.scenes import scene_of
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import DEMO, Config, config_from_dict
from endotsr.studies.sweeps.execute import execute
from endotsr.studies.windows.make import make_windows, plan_recording
from endotsr.studies.windows.plan import Wanted
from endotsr.studies.windows.survey import SurveyedFrame

FRAMES = 56
SIZE = SimulatorSettings(width=48, height=40, frames=FRAMES)
WANTED = Wanted(32, 8, 1)  # frames 0:32 and 24:56
COLD, WARM = 1500, 600  # iterations of the windows of a chain
CHAIN = (
    "--windows", "32", "--chain", "2", "--preset", "demo", "--iterations", f"{COLD}", "--no-evaluate",
    "--initialisation.first-frame-points", "300", "--initialisation.other-frame-points", "100",
    "--density.maximum", "600",
)  # fmt: skip


def settings(iterations: int = 20, **sections: dict) -> Config:
    """The preset `demo` with few points and iterations."""
    small = {
        "preset": "demo",
        "initialisation": {"first_frame_points": 300, "other_frame_points": 100},
        "density": {"maximum": 600, "interval": 5},
        "training": {
            "iterations": iterations,
            "checkpoint_every": 4,
            "residual_activation": 8,
            "harmonics_interval": 2,
        },
    }
    for name, values in sections.items():
        small[name] = {**small.get(name, {}), **values}
    return config_from_dict(small)


def write_recording(folder: Path, effects: str = "breathing,highlights", frames: int = FRAMES) -> Path:
    """The recording, in the layout of EndoNeRF."""
    folder.mkdir()
    write_sequence(folder, scene_of(effects, msgspec.structs.replace(SIZE, frames=frames)))
    return folder


def frames(count: int, **named: dict[int, object]) -> list[SurveyedFrame]:
    """Frames as a survey finds them; `cut={40: "..."}` changes the field of single frames."""
    found = [SurveyedFrame(f"{i:06d}", tissue=0.9, motion=1e-4) for i in range(count)]
    for field, values in named.items():
        for i, value in values.items():
            found[i] = found[i]._replace(**{field: value})
    return found


class Heard:
    """A reporter that keeps what it is told."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def begin(self, steps: int) -> None:
        self.steps = steps

    def step(self, count: int = 1) -> None:
        pass

    def say(self, message: str) -> None:
        self.lines.append(message)


def here(jobs):
    """The runs made in this process, one after another."""
    for job in jobs:
        yield execute(job, 1)


def trained(source: Path, out: Path, wanted: Wanted = WANTED, config: Config | None = None) -> Heard:
    """A recording trained in windows."""
    heard = Heard()
    plan_recording(source, config or settings(), wanted, out)
    make_windows(out, here, heard)
    return heard


assert DEMO.initialisation.motion == "flow", "a warm start follows the tissue where the settings do"
