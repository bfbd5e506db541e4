"""`endotsr export`: a trained scene as .ply files, a point cloud, or one small file."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result


@dataclass
class ExportOptions:
    """Write a scene for other programs, or as a slim model that `render`, `view` and `export` read.

    SCENE is a run folder, a slim model, or a 3DGS .ply file. The ending of --out chooses what is written: `.npz` is a
    slim model of the whole scene, `.ply` is one time of it, and a name without an ending is a folder with one .ply
    file for every time.
    """

    scene: Annotated[Path, Option("SCENE", positional=True)]
    """run folder, slim model (.npz) or 3DGS file (.ply)"""
    out: Annotated[Path, Option("FILE|DIR")]
    """FILE.ply, FILE.npz, or a folder to create"""
    content: Literal["gaussians", "points", "mesh"] = "gaussians"
    """content of a .ply file: Gaussians as 3DGS viewers read them, centres with colours, or the visible surface"""
    times: Annotated[tuple[float, ...], Option("T [T ...]")] = ()
    """normalised times in [0, 1]"""
    frames: Literal["test", "train", "all"] | None = None
    """the times of frames instead of --times"""
    count: Annotated[int | None, Option("N")] = None
    """number of times, evenly spaced over [0, 1], instead of --times"""
    opacity: float = 0.1
    """least opacity of a Gaussian whose centre becomes a point"""
    voxel: float | None = None
    """side of a voxel of a mesh, in scene units (default: 1.5 pixels at the median depth)"""
    without: tuple[Literal["appearance", "spectral_motion"], ...] = ()
    """components to leave out"""
    json: JsonFile = None
    """also write what was written as JSON"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.export.files import Content, export
    from endotsr.export.scene import open_scene
    from endotsr.export.times import Times
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.files import refuse_unwritable

    options = parse(ExportOptions, words, "export")
    refuse_unwritable(options.json)
    use_threads(options.threads)
    times = Times(options.times, options.frames, options.count)
    content = Content(options.content, options.opacity, options.without, options.voxel)
    said = export(open_scene(options.scene), options.out, times, content)
    print(said)
    files = sorted(options.out.iterdir()) if options.out.is_dir() else [options.out]
    sizes = {file.name: file.stat().st_size for file in files}
    write_result(options.json, out=options.out, content=options.content, bytes=sizes, said=said)
    return 0
