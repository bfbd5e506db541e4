"""Rows of `inputs_tried.py` about times of pictures: lists beside them and names in seconds."""

from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import (
    STEP,
    Row,
    close,
    folder_of,
    lens_of,
    matrices,
    named,
    pair,
    prepare,
    quaternions,
    timed,
    true_rig,
)
from made_videos import pictures

from endotsr.clips.sequences.sequence_file import read_sequence_file

ONE_MISSING = [0, 40, 80, 160, 200, 240, 280, 320, 360, 400, 440, 480]  # ms; one of thirteen
EPOCH = 1403636579.763555584


def listed(text: str, *words: str, name: str = "timestamps.txt"):
    """A folder of twelve pictures, and a list beside them."""

    def change(folder: Path) -> None:
        (folder / "clip" / name).write_bytes(text.encode())

    return folder_of(pictures(), *words, change=change)


def time_lines(of, separator: str = "\n") -> str:
    return separator.join(of(k, ms) for k, ms in enumerate(ONE_MISSING)) + separator


def two_lists(folder: Path) -> list[str]:
    words = listed(time_lines(lambda k, ms: f"{ms / 1e3:.3f}"), name="times.txt")(folder)
    (folder / "clip/timestamps_imu.csv").write_text("0.0\n0.1\n0.2\n")
    return words


def is_even(folder: Path) -> bool:
    found = read_sequence_file(folder / "o")
    return found.times is None and found.frame_rate == 0


def later_path(folder: Path, begin: int) -> np.ndarray:
    """Lines of a trajectory of TUM on the clock of the pictures, which begins with picture `begin`."""
    found = matrices(folder)[begin:]
    ticks = np.repeat(np.arange(len(found)) + begin, 4) + np.tile(np.arange(4) / 4, len(found))
    rows = np.column_stack([found[:, :, 3] / 1e3, quaternions(found)])
    return np.column_stack([EPOCH + STEP / 1e9 * ticks, np.repeat(rows, 4, axis=0)])


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
TIME_ROWS = [
    Row("times, times.txt of KITTI", pair(names=("image_2", "image_3"),
        change=lambda clip: (clip / "times.txt").write_text(time_lines(lambda k, ms: f"{ms / 1e3:e}"))), "told",
        "times.txt: times of the pictures in seconds, 0.48 s in all", timed(ONE_MISSING)),
    Row("times, nanoseconds by the head line", listed(IN_NANOSECONDS), "told", "times of the pictures in nanoseconds",
        timed(ONE_MISSING)),
    Row("times, milliseconds, not stated", listed(time_lines(lambda k, ms: str(ms))), "told",
        "pictures in milliseconds", timed(ONE_MISSING)),
    Row("times, microseconds of a running clock", listed(time_lines(lambda k, ms: str(5400_000_000 + ms * 1000))),
        "told", "pictures in microseconds", timed(ONE_MISSING)),
    Row("times, seconds from 1970, one picture in ten seconds", listed(time_lines(lambda k, ms: str(1.4e9 + ms / 4))),
        "told", "pictures in seconds, 120 s in all", timed([250 * ms for ms in ONE_MISSING])),
    Row("times, dates", listed(time_lines(lambda k, ms: f"2011-09-26 13:02:25.{100 + ms:03d}389445")), "told",
        "pictures in seconds", timed(ONE_MISSING)),
    Row("times by the names of the pictures, in another order", listed("\n".join([*reversed(NAMED.splitlines()[1:]),
        "clip\\9999.png,1403636599.0"]), name="timestamps.csv"), "told", "1 lines name no picture", timed(ONE_MISSING)),
    Row("times, frame numbers and times", listed(time_lines(lambda k, ms: f"{k} {ms / 1e3:.3f}")), "told",
        "pictures in seconds", timed(ONE_MISSING)),
    Row("times, the head line names a column among three", listed("sec,exposure,gain\n" + time_lines(lambda k,
        ms: f"{ms / 1e3:.3f},{20 + k % 3}.5,{k % 5}"), name="timestamps.csv"), "told", "pictures in seconds",
        timed(ONE_MISSING)),
    Row("times, a line fewer than pictures", listed("\n".join(time_lines(lambda k, ms: str(ms)).split()[:-1])), "told",
        "not used as times of the pictures: 11 lines for 12 pictures", is_even),
    Row("times, a picture without a line", listed("\n".join(NAMED.splitlines()[:-1])), "told",
        "it has no line for 0011.png", is_even),
    Row("times, numbers of frames", listed(time_lines(lambda k, ms: str(k))), "told", "it counts frames", is_even),
    Row("times that go back", listed(time_lines(lambda k, ms: str(ms % 300))), "told", "its times do not ascend",
        is_even),
    Row("times of no camera", listed(time_lines(lambda k, ms: f"{k * 1e-4:.4f}")), "told", "pictures a second, if its",
        is_even),
    Row("times, several columns without a head line", listed(time_lines(lambda k, ms: f"{ms} {ms + 1} 7")), "told",
        "it has 3 columns", is_even),
    Row("times, no numbers", listed("to be written\n"), "told", "it holds no number", is_even),
    Row("times and --source-rate", listed(time_lines(lambda k, ms: str(ms)), "--source-rate", "25"), "told",
        "--source-rate overrides it", lambda folder: read_sequence_file(folder / "o").frame_rate == 25),
    Row("times, two lists", two_lists, "told", "timestamps_imu.csv: not used as times of the pictures: another list",
        timed(ONE_MISSING)),
    Row("times and a trajectory that begins later", on_one_clock(by_names=False), "told",
        "on the clock of the pictures", lambda folder: true_rig(folder, slice(3, None))),
    Row("names with times of unlike length", named(lambda k: f"{10 + 0.25 * k}.png"), "refused", "number of decimals"),
    Row("names with times of one length", named(lambda k: f"{10 + 0.25 * k:.2f}.png"), "right", "", close(pictures(),
        0.01)),
    Row("pictures named by their seconds", named(lambda k: f"{1305031102 + k * k / 10:.6f}.png", pictures(4)), "told",
        "read as seconds", timed([0, 100, 400, 900])),
    Row("names in seconds and a trajectory that begins later", on_one_clock(by_names=True), "told",
        "on the clock of the pictures", lambda folder: true_rig(folder, slice(3, None))),
]  # fmt: skip
