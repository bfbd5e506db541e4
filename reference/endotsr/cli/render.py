"""`endotsr render`: pictures and films of a trained scene at any time, from any camera."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.untrusted.names import counted

if TYPE_CHECKING:
    from endotsr.results.export.scene import MovingScene

OF_ONE_FRAME = "; the view of one frame is --camera FRAME, and its time --times T, from 0 to 1"


@dataclass
class RenderOptions:
    """Render a scene as pictures (--out), as a film (--film), or both.

    SCENE is a run folder (with or without windows), a slim model from `endotsr export`, or a 3DGS .ply file. Times are
    those of frames or any others in [0, 1]; a time between frames uses the camera of the nearest frame. The folder
    contains colour/, depth/, opacity/ and render.json (time, camera and file of every picture, depth scale).
    """

    scene: Annotated[Path, Option("SCENE", positional=True)]
    """run folder, slim model (.npz) or 3DGS file (.ply)"""
    out: Annotated[Path | None, Option("DIR")] = None
    """folder of pictures to create"""
    film: Annotated[Path | None, Option("FILE")] = None
    """film to write: .mp4 (H.264), .webm (VP9) or .gif"""
    times: Annotated[tuple[float, ...], Option("T [T ...]")] = ()
    """normalised times in [0, 1]"""
    frames: Annotated[Literal["test", "train", "all"] | None, Option(otherwise=OF_ONE_FRAME)] = None
    """the frames of the sequence instead of --times (default: test; for a film only: all)"""
    count: Annotated[int | None, Option("N")] = None
    """number of times, evenly spaced over [0, 1], instead of --times"""
    camera: Annotated[str, Option("observed|orbit|sway|FRAME|PATH.json")] = "observed"
    """the frames' cameras, a circle around them, from side to side, the camera of one frame, or a camera file"""
    angle: float = 8.0
    """largest rotation of orbit and sway, degrees"""
    offset: Annotated[tuple[float, float, float], Option("RIGHT DOWN FORWARD")] = (0.0, 0.0, 0.0)
    """shift of the camera along its own axes, scene units"""
    size: Annotated[str, Option("WIDTHxHEIGHT")] = ""
    """size of a picture (default: the camera's), with at least the camera's field of view"""
    depth: Literal["accumulated", "normalised"] = "accumulated"
    """depth as composited, or divided by the opacity"""
    panels: tuple[Literal["render", "truth", "error", "depth", "opacity"], ...] = ("render",)
    """panels of a film, left to right; truth and error need the times and cameras of frames"""
    rate: float | None = None
    """pictures per second of a film (default: real time; 15 if the frame rate is unknown)"""
    slow: Annotated[float | None, Option("N")] = None
    """slow-down of a film by a factor of N relative to the recording, instead of --rate"""
    npy: bool = False
    """also write float arrays: colour (3, H, W), depth and opacity (H, W)"""
    texture: bool = False
    """add what the training frames around each time record and the scene lacks, as seen by the cameras of the frames"""
    without: tuple[Literal["appearance", "spectral_motion"], ...] = ()
    """components to omit"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """current location of the sequence of the run, for truth, error and --texture (default: the recorded one)"""
    replace: bool = False
    """replace an existing film that endotsr did not write"""
    json: JsonFile = None
    """also write a record of the output as JSON"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.method.kernels.threads import use_threads
    from endotsr.results.export.times import Times
    from endotsr.results.views import pictures
    from endotsr.results.views.film import speed_in_words, write_film
    from endotsr.results.views.plan import ViewRequest
    from endotsr.results.views.texture import check_texture, with_texture
    from endotsr.studies.windows.scene import shown_frames

    options = parse(RenderOptions, words, "render")
    times = Times(options.times, options.frames, options.count)
    request = ViewRequest(times, options.camera, options.offset, options.size, options.angle)
    pictures.check_outputs(options.out, options.film, options.rate, options.slow, options.replace)
    use_threads(options.threads)
    scene = _opened(options)
    if options.texture:
        check_texture(scene)
    views = pictures.requested_views(scene, request, "test" if options.out else "all")
    shown_at, duration = [view.time for view in views], scene.record.duration
    rate = _rate(options, shown_at, duration)
    look = pictures.Look(options.depth, options.without, options.panels)
    sequence = shown_frames(scene, options.panels, views, options.sequence) if options.film else None
    made = pictures.rendered(scene, views, look)
    if options.texture:
        made = with_texture(scene, made, sequence, options.sequence, options.without)

    def film(shown) -> None:
        if options.film and rate:
            count = write_film(options.film, pictures.film_pictures(shown, look, sequence), rate)
            speed = speed_in_words(shown_at, duration, rate)
            print(f"{options.film}: {counted(count, 'picture')}, {count / rate:.1f} s{speed}")
        else:
            pictures.dropped(shown)

    if options.out:
        count = pictures.write_pictures(options.out, scene, made, look, options.npy, film)
        print(f"{counted(count, 'picture')} in {options.out}: colour/, depth/, opacity/, render.json")
    else:
        film(made)
    write_result(options.json, folder=options.out, film=options.film, rate=rate, times=shown_at)
    return 0


def _opened(options: RenderOptions) -> "MovingScene":
    """The scene, whose notes are printed. Raises: InputError if an output lies in the folder of its frames."""
    from endotsr.studies.windows.scene import open_any
    from endotsr.training.runs.sources import refuse_inside_data

    scene = open_any(options.scene)
    print(*(f"  {note}\n" for note in scene.notes), sep="", end="")
    for path in filter(None, (options.out, options.film)):
        if scene.folder is not None:
            refuse_inside_data(path, scene.folder)
    return scene


def _rate(options: RenderOptions, times: list[float], duration: float) -> float | None:
    """Pictures per second of the film, as it plays; None without one."""
    from endotsr.results.views.film import film_rate, played_rate

    if options.film is None:
        return None
    return played_rate(options.film, options.rate or film_rate(options.film, times, duration, options.slow))
