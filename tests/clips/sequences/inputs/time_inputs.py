"""Rows of `inputs_tried.py` about times of pictures: lists beside them and names in seconds."""

from functools import partial
from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import lens_of, matrices, named, pair, prepare, put, quaternions, twelve, with_files
from input_rows import EXACT, STEP, refused, right, timed, told, true_rig
from made_videos import pictures

from endotsr.clips.sequences.sequence_file import read_sequence_file

ONE_MISSING = [0, 40, 80, 160, 200, 240, 280, 320, 360, 400, 440, 480]  # ms; one of thirteen
EPOCH = 1403636579.763555584
UNEVENLY = timed(ONE_MISSING)
MILLISECONDS = "\n".join(map(str, ONE_MISSING))


def listed(text: str, *words: str, name: str = "timestamps.txt", more: dict[str, str] | None = None):
    """A folder of twelve pictures, and lists beside them."""

    def change(folder: Path) -> None:
        for file, content in ({name: text} | (more or {})).items():
            put(folder / "clip" / file, content)

    return twelve(*words, change=change)


def time_lines(of, separator: str = "\n") -> str:
    return separator.join(of(k, ms) for k, ms in enumerate(ONE_MISSING)) + separator


def is_even(folder: Path) -> bool:
    found = read_sequence_file(folder / "o")
    return found.times is None and found.frame_rate == 0


def later_path(folder: Path, begin: int) -> np.ndarray:
    """Lines of a trajectory of TUM on the clock of the pictures, which begins with picture `begin`; 4 for each."""
    found = np.repeat(matrices(folder)[begin:], 4, axis=0)
    ticks = np.arange(len(found)) / 4 + begin
    return np.column_stack([EPOCH + STEP / 1e9 * ticks, found[:, :, 3] / 1e3, quaternions(found)])


@builder
def on_one_clock(folder: Path, by_names: bool) -> list[str]:
    """Pictures with their times, in a list or as their names, and a trajectory that begins with the fourth."""
    np.savetxt(folder / "path.txt", later_path(folder, 3), fmt="%.9f")
    images = sorted((folder / "clip/images").iterdir())
    times = [f"{EPOCH + STEP / 1e9 * k:.6f}" for k in range(len(images))]
    if by_names:
        for file, time in zip(images, times):
            file.rename(file.with_name(f"{time}.png"))
    else:
        (folder / "clip/images/timestamps.txt").write_text("\n".join(times) + "\n")
    lens = ("--camera", *map(str, lens_of(folder / "clip")))
    words = ("--trajectory", str(folder / "path.txt"), "--gaps", "drop")
    return prepare("clip/images", *words, camera=lens)(folder)


IN_NANOSECONDS = "#timestamp [ns]\r\n" + time_lines(lambda k, ms: f"{1403636579763555584 + ms * 10**6}", "\r\n")
NAMED = "filename,timestamp\n" + time_lines(lambda k, ms: f"clip\\{k:04d}.png,{EPOCH + ms / 1e3:.6f}")
later_poses = partial(true_rig, kept=slice(3, None))
TIME_ROWS = [
    told("times, times.txt of KITTI", pair(names=("image_2", "image_3"), change=with_files("times.txt",
        text=time_lines(lambda k, ms: f"{ms / 1e3:e}"))), "times.txt: times of the pictures in seconds, 0.48 s in all",
        UNEVENLY),
    told("times, nanoseconds by the head line", listed(IN_NANOSECONDS), "times of the pictures in nanoseconds",
        UNEVENLY),
    told("times, milliseconds, not stated", listed(MILLISECONDS), "pictures in milliseconds", UNEVENLY),
    told("times, microseconds of a running clock", listed(time_lines(lambda k, ms: str(5400_000_000 + ms * 1000))),
        "pictures in microseconds", UNEVENLY),
    told("times, seconds from 1970, one picture in ten seconds", listed(time_lines(lambda k, ms: str(1.4e9 + ms / 4))),
        "pictures in seconds, 120 s in all", timed([250 * ms for ms in ONE_MISSING])),
    told("times, dates", listed(time_lines(lambda k, ms: f"2011-09-26 13:02:25.{100 + ms:03d}389445")),
        "pictures in seconds", UNEVENLY),
    told("times by the names of the pictures, in another order", listed("\n".join([*reversed(NAMED.splitlines()[1:]),
        "clip\\9999.png,1403636599.0"]), name="timestamps.csv"), "1 lines name no picture", UNEVENLY),
    told("times, frame numbers and times", listed(time_lines(lambda k, ms: f"{k} {ms / 1e3:.3f}")),
        "pictures in seconds", UNEVENLY),
    told("times, the head line names a column among three", listed("sec,exposure,gain\n" + time_lines(lambda k,
        ms: f"{ms / 1e3:.3f},{20 + k % 3}.5,{k % 5}"), name="timestamps.csv"), "pictures in seconds", UNEVENLY),
    told("times, a line fewer than pictures", listed(MILLISECONDS.rpartition("\n")[0]),
        "not used as times of the pictures: 11 lines for 12 pictures", is_even),
    told("times, a picture without a line", listed("\n".join(NAMED.splitlines()[:-1])), "it has no line for 0011.png",
        is_even),
    told("times, numbers of frames", listed(time_lines(lambda k, ms: str(k))), "it counts frames", is_even),
    told("times that go back", listed(time_lines(lambda k, ms: str(ms % 300))), "its times do not ascend", is_even),
    told("times of no camera", listed(time_lines(lambda k, ms: f"{k * 1e-4:.4f}")), "pictures a second, if its",
        is_even),
    told("times, several columns without a head line", listed(time_lines(lambda k, ms: f"{ms} {ms + 1} 7")),
        "it has 3 columns", is_even),
    told("times, no numbers", listed("to be written\n"), "it holds no number", is_even),
    told("times and --source-rate", listed(MILLISECONDS, "--source-rate", "25"), "--source-rate overrides it",
        lambda folder: read_sequence_file(folder / "o").frame_rate == 25),
    told("times, two lists", listed(time_lines(lambda k, ms: f"{ms / 1e3:.3f}"), name="times.txt",
        more={"timestamps_imu.csv": "0.0\n0.1\n0.2\n"}),
        "timestamps_imu.csv: not used as times of the pictures: another list", UNEVENLY),
    told("times and a trajectory that begins later", on_one_clock(by_names=False), "on the clock of the pictures",
        later_poses),
    refused("names with times of unlike length", named(lambda k: f"{10 + 0.25 * k}.png"), "number of decimals"),
    right("names with times of one length", named(lambda k: f"{10 + 0.25 * k:.2f}.png"), EXACT),
    told("pictures named by their seconds", named(lambda k: f"{1305031102 + k * k / 10:.6f}.png", pictures(4)),
        "read as seconds", timed([0, 100, 400, 900])),
    told("names in seconds and a trajectory that begins later", on_one_clock(by_names=True),
        "on the clock of the pictures", later_poses),
]  # fmt: skip
