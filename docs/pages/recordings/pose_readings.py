"""Give right and wrongly read poses to the check of poses, and write the table of its verdicts.

    python docs/make.py recordings.pose_readings measure [--data ../shared/data] [--seeds 3]

The simulated clips are those of `hand_held` with a hand-held camera; their true poses are known. `sinus_endoscopy` is
real, with the poses of a reconstruction. Each wrong set of poses is made by a formula of this file, independent of the
readings that the check knows. A verdict is right if it names the reading that gives the true poses back. For the still
camera of EndoNeRF pulling, poses of a hand-held path are given.
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.poses.agreement import Agreement, agreement
from endotsr.clips.poses.estimate import movement_of
from endotsr.clips.poses.readings import readings
from endotsr.clips.poses.views import Views
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.splatting.camera import CameraPose
from pages.recordings.hand_held_clips import FRAMES, SMALL, recorded, simulated
from pages.store.program import DATA, Program
from pages.store.tables import noted, where

CLIPS = ("rigid", "breathing", "breathing, pull, instrument")
REAL, STILL, OTHER = "sinus_endoscopy", "endonerf_pulling", "poses of a moving camera"
EQUAL = 1e-6  # rotations, and centres relative to their spread
Columns = NDArray[np.float64]


def _quaternions(turn: Columns, order: list[int]) -> Columns:
    """Rotations whose quaternions, written in one order, are read in another."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(Rotation.from_matrix(turn).as_quat()[:, order]).as_matrix()


def _column(turn: Columns, order: list[int], signs: list[int]) -> Columns:
    return turn[:, :, order] * signs


# From rotations and centres, camera to world in OpenCV axes, to what a reader has that takes the file for another.
WRONG: dict[str, Callable[[Columns, Columns], tuple[Columns, Columns]]] = {
    "as written": lambda turn, centre: (turn, centre),
    "inverse": lambda turn, centre: (turn.mT, -np.einsum("nji,nj->ni", turn, centre)),
    "OpenGL's axes": lambda turn, centre: (_column(turn, [0, 1, 2], [1, -1, -1]), centre),
    "LLFF's axes": lambda turn, centre: (_column(turn, [1, 0, 2], [1, -1, 1]), centre),
    "quaternion w x y z": lambda turn, centre: (_quaternions(turn, [3, 0, 1, 2]), centre),
    "unit 1000 times as long": lambda turn, centre: (turn, 1000 * centre),
    "unit 1000 times as short": lambda turn, centre: (turn, centre / 1000),
    "one frame late": lambda turn, centre: (np.roll(turn, 1, 0), np.roll(centre, 1, 0)),
}


def poses_of(sequence: Sequence) -> tuple[Columns, Columns]:
    """Rotations (n, 3, 3) and centres (n, 3), camera to world."""
    turn = np.array([camera.rotation.T for camera in sequence.cameras], np.float64)
    shift = np.array([camera.translation for camera in sequence.cameras], np.float64)
    return turn, -np.einsum("nij,nj->ni", turn, shift)


def world_to_camera(turn: Columns, centre: Columns) -> list[CameraPose]:
    """The poses of a reader."""
    return [CameraPose(t.T, -t.T @ c) for t, c in zip(turn, centre, strict=True)]


def restored(found: Agreement, given: list[CameraPose], true: list[CameraPose]) -> bool:
    """Whether the reading that a verdict names gives the true poses, without the first and the last frame."""
    named = next(reading.poses for reading in readings(given) if reading.name == found.reading)[1:-1]
    size = np.ptp([pose.translation for pose in true], axis=0).max()
    return all(
        np.abs(a.rotation - b.rotation).max() < EQUAL and np.abs(a.translation - b.translation).max() < EQUAL * size
        for a, b in zip(named, true[1:-1], strict=True)
    )


def verdicts(sequence: Sequence, wrong: dict[str, list[CameraPose]]) -> dict[str, Any]:
    """The verdict on every set of poses, and the processor time of one check."""
    true, found = world_to_camera(*poses_of(sequence)), {}
    begun = time.process_time()
    matcher, pairs, _ = movement_of(Views(sequence.images, sequence.masks, sequence.depth, sequence.cameras[0]))
    matched = time.process_time() - begun
    for name, given in wrong.items():
        begun = time.process_time()
        one = agreement(matcher, given, pairs)
        found[name] = one._asdict() | {"seconds": matched + time.process_time() - begun}
        found[name]["restored"] = one.verdict == "misread" and restored(one, given, true)
    return {"frames": sequence.count, "pairs": len(pairs), "verdicts": found}


def of_clip(clip: str, seed: int, data: Path) -> dict[str, Any]:
    """Every wrong reading of a clip."""
    if clip == STILL:
        import endotsr

        sequence = endotsr.load_sequence(data / clip)
        hand = world_to_camera(*poses_of(simulated("rigid", SMALL, seed)))
        return verdicts(sequence, {OTHER: [hand[k % len(hand)] for k in range(sequence.count)]})
    sequence = recorded(clip, data) if clip == REAL else simulated(clip, SMALL, seed)
    turn, centre = poses_of(sequence)
    return verdicts(sequence, {name: world_to_camera(*read(turn, centre)) for name, read in WRONG.items()})


def outcome(name: str, one: dict[str, Any]) -> str:
    """A verdict in words of the table."""
    if name == "as written" or one["verdict"] != "misread":
        said: dict[str, str] = {"fits": "accepted", "wrong": "refused without a name"}
        return said.get(one["verdict"], str(one["verdict"]))
    return "named" if one["restored"] else f"named wrongly ({one['reading']})"


def table(result: dict[str, Any]) -> str:
    """What is said of every set of poses, by clip."""
    answers = result["answers"]
    heads = list(dict.fromkeys(answer["clip"] for answer in answers))
    rows = []
    for name in [*WRONG, OTHER]:
        cells = []
        for head in heads:
            ones = [a["verdicts"][name] for a in answers if a["clip"] == head and name in a["verdicts"]]
            said = [outcome(name, one) for one in ones]
            counted = dict.fromkeys(said)
            cells.append(", ".join(f"{word} {said.count(word)}/{len(said)}" for word in counted) or "-")
        rows.append([name, *cells])
    seconds = [one["seconds"] * 60 / a["frames"] for a in answers for one in a["verdicts"].values()]
    about = (
        f"Simulated clips of {FRAMES} frames of {SMALL[0]}x{SMALL[1]}, {result['seeds']} seeds; a recorded clip once."
        f" A check takes {min(seconds):.1f} to {max(seconds):.1f} s of processor time for 60 frames,"
        f" {where(result)}."
    )
    return noted(["Poses are read as", *(f"`{head}`" if "_" in head else head for head in heads)], rows, about)


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Every clip with its seeds."""
    wanted = [(clip, seed) for clip in CLIPS for seed in range(options.seeds)] + [(REAL, 0), (STILL, 0)]
    answers = [{"clip": clip, "seed": seed} | of_clip(clip, seed, options.data) for clip, seed in wanted]
    return {"seeds": options.seeds, "answers": answers}


PROGRAM = Program(
    __name__, "guides/poses.md", {"table": table}, "pose_readings.json", measured, {"--data": DATA, "--seeds": 3}
)
