"""`endotsr render`: colour, depth and opacity of a trained run at any time in [0, 1]."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.errors import InputError
from endotsr.runs.files import replacing_folder, write_json
from endotsr.runs.folder import RunFolder, open_run


@dataclass
class RenderOptions:
    """Render a run at observed poses, at the times of its frames or at any other time in [0, 1].

    A time between frames is rendered with the camera of the frame nearest in time, or with --camera. The output folder
    holds colour/, depth/, opacity/ and render.json (time, camera frame and file of every picture, depth scale).
    """

    run: Annotated[Path, Option("RUN", positional=True)]
    """run folder"""
    out: Annotated[Path, Option("DIR")]
    """folder to create"""
    times: Annotated[tuple[float, ...], Option("T [T ...]")] = ()
    """normalised times in [0, 1]"""
    frames: Literal["test", "train", "all"] | None = None
    """the frames of the sequence instead of --times (default: test)"""
    count: Annotated[int | None, Option("N")] = None
    """number of times, evenly spaced over [0, 1], instead of --times"""
    camera: Annotated[int | None, Option("FRAME")] = None
    """use the camera of this frame for every picture"""
    npy: bool = False
    """also write float arrays: colour (3, H, W), depth and opacity (H, W)"""
    without: tuple[Literal["appearance", "spectral_motion"], ...] = ()
    """components to leave out of the picture"""
    threads: int = 0
    """threads, 0 = all cores"""


class View(NamedTuple):
    """Time, camera and name of one picture."""

    time: float
    frame: int  # whose camera
    label: str


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.folder import refuse_existing
    from endotsr.runs.sources import refuse_inside_data

    options = parse(RenderOptions, words, "render")
    folder = open_run(options.run)
    views = wanted_views(folder.sequence_record("names", "times", "train_index", "test_index"), options)
    refuse_existing(options.out)
    refuse_inside_data(options.out, folder)
    use_threads(options.threads)
    render = renderer(folder, without=options.without)
    options.out.absolute().parent.mkdir(parents=True, exist_ok=True)
    with replacing_folder(options.out, replace=False) as target:
        write_views(target, folder, views, render, options.npy)
    print(f"{len(views)} pictures in {options.out}: colour/, depth/, opacity/, render.json")
    return 0


def wanted_views(record: dict[str, Any], options: RenderOptions) -> list[View]:
    """The pictures selected by the options. Raises InputError for a time or frame that does not exist."""
    from endotsr.runs.sources import nearest_frame

    given = [bool(options.times), options.frames is not None, options.count is not None]
    if sum(given) > 1:
        raise InputError("render: give one of --times, --frames and --count")
    count = len(record["names"])
    if options.camera is not None and not 0 <= options.camera < count:
        raise InputError(f"render: --camera {options.camera} is not allowed; allowed: a frame from 0 to {count - 1}")
    if options.times or options.count is not None:
        times = list(options.times) or _even(options.count or 0)
        for time in times:
            if not 0.0 <= time <= 1.0:
                raise InputError(f"render: --times {time:g} is not allowed; allowed: times in [0, 1]")
        views = [View(t, nearest_frame(record["times"], t), f"{i:05d}") for i, t in enumerate(times)]
    else:
        index = {"test": record["test_index"], "train": record["train_index"], "all": range(count)}
        views = [View(record["times"][i], i, record["names"][i]) for i in index[options.frames or "test"]]
    return [v if options.camera is None else v._replace(frame=options.camera) for v in views]


def _even(count: int) -> list[float]:
    if count < 1:
        raise InputError(f"render: --count {count} is not allowed; allowed: an integer >= 1")
    return [i / max(count - 1, 1) for i in range(count)]


def renderer(folder: RunFolder, without: tuple[str, ...] = ()):
    """(time, camera) -> RenderOut of the run's latest checkpoint."""
    from endotsr.fitting.model import render_at
    from endotsr.runs.model import load_model

    model = load_model(folder)
    appearance, motion = "appearance" not in without, "spectral_motion" not in without

    def render(time: float, camera):
        return render_at(
            model.gaussians,
            model.spectral,
            model.config,
            camera,
            time,
            frames=model.frames,
            appearance=appearance,
            spectral_motion=motion,
        )

    return render


def write_views(target: Path, folder: RunFolder, views: list[View], render, npy: bool) -> None:
    """Render and write every view below `target`, then render.json."""
    import numpy as np

    from endotsr.opencv import write_png
    from endotsr.report.pictures import depth_bytes, depth_step, grey_bytes, rgb_bytes
    from endotsr.runs.sources import remembered_cameras

    record = folder.sequence_record("names", "cameras", "static_camera", "unit")
    cameras = remembered_cameras(record)
    for name in ("colour", "depth", "opacity"):
        (target / name).mkdir()
    step = None
    entries = []
    for view in views:
        out = render(view.time, cameras[view.frame])
        step = step or depth_step(record, out.depth)
        write_png(target / "colour" / f"{view.label}.png", rgb_bytes(out.colour))
        write_png(target / "depth" / f"{view.label}.png", depth_bytes(out.depth, step))
        write_png(target / "opacity" / f"{view.label}.png", grey_bytes(out.opacity))
        if npy:
            for name in ("colour", "depth", "opacity"):
                np.save(target / name / f"{view.label}.npy", getattr(out, name))
        entries.append({"file": f"{view.label}.png", "time": view.time, "camera_of_frame": view.frame})
    about = f"depth PNG value x depth_step = view-space z in {record['unit']}, not normalised by opacity"
    write_json(target / "render.json", {"depth_step": step, "about": about, "pictures": entries})
