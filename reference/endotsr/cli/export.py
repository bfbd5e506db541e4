"""`endotsr export`: a trained scene as .ply files, points, a mesh, a slim model, or an interactive page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.related_options import EXPORT
from endotsr.cli.parts.relations import check_relations
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.untrusted.names import counted

# The fact `format` of related_options: what --out writes, by its ending.
FORMATS = {".htm": "page", ".html": "page", ".npz": "slim model", ".glb": "animated points", ".ply": "one time"}


@dataclass
class ExportOptions:
    """Write a scene for other programs, as an interactive page, or as a slim model for `render` and `export`.

    SCENE is a run folder, a slim model, or a 3DGS .ply file. A run of windows can be written as .ply files and as a
    page; each of its windows in all formats. The extension of --out selects the format: `.npz` is a slim model of the
    whole scene, `.html` an interactive page, `.glb` animated points, `.ply` the scene at one time, and a name without
    extension a folder with one .ply file per time.

    The page needs a browser with WebGL 2, but no server, no network and no other file. It stores positions and shapes
    at key times and interpolates between them; colours are those seen from the observed camera. The page of a run of
    windows loads the current window from a folder next to it.
    """

    scene: Annotated[Path, Option("SCENE", positional=True)]
    """run folder, slim model (.npz) or 3DGS file (.ply)"""
    out: Annotated[Path, Option("FILE|DIR")]
    """FILE.ply, FILE.glb, FILE.npz, PAGE.html, or a folder to create"""
    content: Literal["gaussians", "points", "mesh"] = "gaussians"
    """content of a .ply file: Gaussians for 3DGS viewers, coloured centres, or the visible surface"""
    times: Annotated[tuple[float, ...], Option("T [T ...]")] = ()
    """normalised times in [0, 1]"""
    frames: Literal["test", "train", "all"] | None = None
    """the times of frames instead of --times"""
    count: Annotated[int | None, Option("N")] = None
    """number of times, evenly spaced over [0, 1], instead of --times"""
    opacity: float = 0.1
    """with points, .glb included: minimum opacity of a Gaussian"""
    voxel: float | None = None
    """with mesh: side of a voxel, scene units (default: 1.5 pixels at the median depth)"""
    without: tuple[Literal["appearance", "spectral_motion"], ...] = ()
    """components to omit"""
    keys: Annotated[int | None, Option("N")] = None
    """for a page: maximum number of key times, default 32 (16 per window); more make it smoother and larger"""
    title: str = ""
    """for a page: heading (default: the name of the scene)"""
    held_out: bool = True
    """for a page: show held-out frames and error; needs the sequence of the run"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """for a page: current location of the sequence of the run (default: the recorded one)"""
    replace: bool = False
    """replace an existing file that endotsr did not write"""
    json: JsonFile = None
    """also write a record of the output as JSON"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.method.kernels.threads import use_threads
    from endotsr.results.export.files import Content, export
    from endotsr.results.export.times import Times
    from endotsr.studies.windows.scene import open_any, refuse_one_set
    from endotsr.training.runs.files import refuse_replacing

    options = parse(ExportOptions, words, "export")
    kind = FORMATS.get(options.out.suffix.lower(), "folder")
    check_relations("export", EXPORT, options, given_names(ExportOptions, words), {"format": kind})
    use_threads(options.threads)
    refuse_one_set(options.scene, options.out)
    if kind != "folder":
        refuse_replacing(options.out, options.replace, "--out")
    times = Times(options.times, options.frames, options.count)
    content = Content(options.content, options.opacity, options.without, options.voxel)
    if kind == "page":
        _write_page(options)
        return 0
    scene = open_any(options.scene)
    said = export(scene, options.out, times, content, options.replace)
    print("\n".join([said, *(f"  {note}" for note in scene.notes)]))
    files = sorted(options.out.iterdir()) if options.out.is_dir() else [options.out]
    sizes = {file.name: file.stat().st_size for file in files}
    write_result(options.json, out=options.out, content=options.content, bytes=sizes, said=said)
    return 0


def _write_page(options: ExportOptions) -> None:
    """Write the interactive page."""
    from endotsr.results.export.scene import open_scene
    from endotsr.results.views.page import KEYS, check_page, write_page
    from endotsr.studies.windows.page import WINDOW_KEYS
    from endotsr.studies.windows.record import is_windowed
    from endotsr.training.runs.sources import load_run_sequence

    usual = WINDOW_KEYS if is_windowed(options.scene) else KEYS
    keys = usual if options.keys is None else options.keys
    check_page(options.out, keys)
    title = options.title or options.scene.absolute().name
    if is_windowed(options.scene):
        _write_windows_page(options, title, keys)
        return
    scene = open_scene(options.scene)
    wanted = options.held_out and scene.folder is not None
    sequence = load_run_sequence(scene.folder, options.sequence) if wanted and scene.folder else None
    size = write_page(options.out, scene, title, keys, sequence)
    print(f"{options.out}: {size / 1e6:.1f} MB, open it in a browser")
    write_result(options.json, page=options.out, bytes=size, held_out=sequence is not None)


def _write_windows_page(options: ExportOptions, title: str, keys: int) -> None:
    """Write the page of a run of windows, and the folder of its windows."""
    from endotsr.studies.windows.page import window_files, write_windows_page
    from endotsr.studies.windows.scene import WindowFrames, open_windows

    scene, folder = open_windows(options.scene), window_files(options.out)
    frames = WindowFrames(scene, options.sequence) if options.held_out else None
    found = write_windows_page(options.out, scene, title, keys, frames)
    print(
        f"{options.out}: {found.page / 1e6:.1f} MB, with {folder}: {counted(len(found.windows), 'window')} of at most"
        f" {max(found.windows) / 1e6:.1f} MB; keep both together and open the page in a browser"
    )
    write_result(
        options.json,
        page=options.out,
        bytes=found.page,
        windows=found.windows,
        folder=folder,
        held_out=frames is not None,
    )
