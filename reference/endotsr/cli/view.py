"""`endotsr view`: a moving scene as one page that anybody opens with a double click."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result


@dataclass
class ViewOptions:
    """Write one page with the moving scene: play, turn, depth, and the held-out frames beside it.

    The page needs no server, no network and no other file; a browser with WebGL 2 draws it. SCENE is a run folder, a
    slim model, or a 3DGS .ply file. Positions and shapes are kept at key times, between which the page interpolates;
    the colours are those that the observed camera sees.
    """

    scene: Annotated[Path, Option("SCENE", positional=True)]
    """run folder, slim model (.npz) or 3DGS file (.ply)"""
    out: Annotated[Path, Option("PAGE.html")]
    """page to write"""
    keys: Annotated[int, Option("N")] = 32
    """largest number of key times; more are smoother and make the page larger"""
    title: str = ""
    """heading of the page (default: the name of the scene)"""
    held_out: bool = True
    """show the held-out frames and the error, if the sequence of the run is found"""
    sequence: Annotated[str | None, Option("SEQUENCE")] = None
    """current location of the sequence of the run (default: the recorded one)"""
    json: JsonFile = None
    """also write the size of the page as JSON"""
    threads: int = 0
    """threads, 0 = all cores"""


def run(words: list[str]) -> int:
    """The command."""
    from endotsr.export.scene import open_scene
    from endotsr.kernels.threads import use_threads
    from endotsr.runs.files import refuse_unwritable
    from endotsr.runs.sources import load_run_sequence
    from endotsr.views.page import check_page, write_page

    options = parse(ViewOptions, words, "view")
    check_page(options.out, options.keys)
    refuse_unwritable(options.out, options.json)
    use_threads(options.threads)
    scene = open_scene(options.scene)
    wanted = options.held_out and scene.folder is not None
    sequence = load_run_sequence(scene.folder, options.sequence) if wanted and scene.folder else None
    title = options.title or options.scene.absolute().name
    size = write_page(options.out, scene, title, options.keys, sequence)
    print(f"{options.out}: {size / 1e6:.1f} MB, open it in a browser")
    write_result(options.json, page=options.out, bytes=size, held_out=sequence is not None)
    return 0
