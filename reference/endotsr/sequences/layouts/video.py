"""A video file: one picture a frame, or stereo pairs side by side or stacked."""

from collections.abc import Iterator
from pathlib import Path

from endotsr.opencv.video import VIDEO_ENDINGS, video_facts, video_pictures
from endotsr.sequences.layouts import Layout
from endotsr.sequences.recording import Pair, Pose, Recording
from endotsr.sequences.source_options import SourceOptions
from endotsr.sequences.sources import halves, split_pair, stated_camera, stated_depth, stated_masks, unit_of
from endotsr.sequences.trajectory import poses_of_frames, read_trajectory


def recognises(path: Path) -> bool:
    """Whether a path is a file with the ending of a video."""
    return path.is_file() and path.suffix.lower() in VIDEO_ENDINGS


def open_video(path: Path, options: SourceOptions) -> Recording:
    """The video as a recording. Raises InputError."""
    facts = video_facts(path)
    stereo = "none" if options.stereo == "auto" else options.stereo
    width, height = halves(facts.width, facts.height, stereo)
    rate = options.rate or facts.rate
    lens, rig = stated_camera(options, width, height, path)
    poses: list[Pose | None] | None = None
    notes = [f"{path.name}: {facts.count} pictures of {facts.width}x{facts.height}, {rate or 0:g} a second"]
    if options.trajectory is not None:
        unit = options.trajectory_unit or "m"
        trajectory = read_trajectory(options.trajectory, unit, options.direction, options.axes)
        poses, how = poses_of_frames(trajectory, facts.count, rate)
        notes.append(f"{options.trajectory.name}: {how}; positions in {unit}")

    def pictures(wanted: list[int]) -> Iterator[Pair]:
        for i, picture in zip(wanted, video_pictures(path, wanted)):
            yield split_pair(picture, stereo, f"{path}: picture {i}")

    return Recording(
        layout="video",
        where=path,
        names=[f"{i:06d}" for i in range(facts.count)],
        pictures=pictures,
        masks=stated_masks(options, facts.count, width, height),
        depth=stated_depth(options, facts.count),
        unit=unit_of(options, "m"),
        lens=lens,
        rig=rig,
        baseline=options.baseline,
        poses=poses,
        rate=rate,
        notes=notes,
    )


LAYOUT = Layout(name="video", about="a video file", rank=5, recognises=recognises, open=open_video)
