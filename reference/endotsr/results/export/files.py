"""`endotsr export`: a slim model, one ply file, animated points, or a folder of ply files, selected by name."""

import re
from pathlib import Path
from typing import Literal, NamedTuple

from endotsr.errors import InputError
from endotsr.results.export.gltf import write_animated_points
from endotsr.results.export.mesh import surface
from endotsr.results.export.model import save_slim_model
from endotsr.results.export.placement import placed_points, placed_scene
from endotsr.results.export.ply import gaussian_vertices, mesh_vertices, point_vertices, write_ply
from endotsr.results.export.scene import MovingScene
from endotsr.results.export.times import Times, chosen_times
from endotsr.training.runs.files import refuse_replacing
from endotsr.training.runs.folder import refuse_existing
from endotsr.untrusted.names import counted
from endotsr.untrusted.writing import replacing_folder

FILM_ENDINGS = (".mp4", ".webm", ".gif", ".avi", ".mov")
ENDING = re.compile(r"\.(?=.*[a-z])[a-z0-9]{1,8}")  # extension of a file; `run.2` and `scale_0.5` are folder names
WRITTEN = (
    "use FILE.ply (Gaussians, points or a mesh at one time), FILE.glb (animated points), FILE.npz (a slim"
    " model), FILE.html (a page), or a name without an ending (a folder of .ply files)"
)


class Content(NamedTuple):
    """The content of a ply file."""

    kind: Literal["gaussians", "points", "mesh"] = "gaussians"
    least_opacity: float = 0.1  # minimum opacity of a point
    taken_out: tuple[str, ...] = ()  # spectral components to leave out
    voxel: float | None = None  # side of a voxel for a mesh, scene units


ALL_TIMES, GAUSSIANS = Times(), Content()
AXES = "axes: x right, y down, z forward in the camera of the first frame"
KEPT_AXES = "axes: those of the ply file that this file was made from"


def check_folder_name(out: Path, of: str, film: str = "", written: str = "") -> None:
    """Raises InputError for a folder name with a file extension.

    of        content of the folder, for the message
    film      advice for the extension of a film
    written   advice for other extensions
    """
    ending = out.suffix.lower()
    if ENDING.fullmatch(ending) and not out.is_dir():
        advice = film if film and ending in FILM_ENDINGS else written or "use a name without an ending"
        raise InputError(f"{out}: --out is a folder of {of}, but this is the name of a {ending} file; {advice}")


def export(
    scene: MovingScene, out: Path, times: Times = ALL_TIMES, content: Content = GAUSSIANS, replace: bool = False
) -> str:
    """Write a scene to `out`; returns one line on the written file. The extension of `out` selects the format:

    .npz    slim model; times or content cannot be chosen
    .glb    animated points; default: at all frames
    .ply    one time; default: the first frame of the sequence
    none    a folder with one ply file per time; default: all frames

    replace   whether a file that endotsr did not write may be replaced
    Raises: InputError for another extension, for invalid times or content, and for a path that cannot be written.
    """
    if not 0.0 <= content.least_opacity <= 1.0:
        raise InputError(f"export: --opacity {content.least_opacity:g} is not allowed; use 0 to 1")
    if content.voxel is not None and content.kind != "mesh":
        raise InputError("export: --voxel applies to a mesh only; use it with --content mesh")
    ending = out.suffix.lower()
    if ending in (".npz", ".glb", ".ply"):
        refuse_replacing(out, replace)
    if ending == ".npz":
        return _slim(scene, out, times, content)
    if ending == ".glb":
        return _animated(scene, out, times, content)
    if ending == ".ply":
        return _one_time(scene, out, times, content)
    check_folder_name(out, "ply files", written=WRITTEN)
    return _every_time(scene, out, times, content)


def _slim(scene: MovingScene, out: Path, times: Times, content: Content) -> str:
    if times.chosen or content != GAUSSIANS:
        raise InputError(f"{out}: a slim model stores all times and the whole scene; use --out alone, or a .ply file")
    if scene.one_time:
        raise InputError(f"{out}: a slim model cannot be made from a .ply file of one time; use a run folder")
    model = scene.model
    save_slim_model(out, model, scene.record)
    size = out.stat().st_size
    kept = (scene.folder.checkpoint, scene.folder.previous) if scene.folder else ()
    whole = next((file.stat().st_size for file in kept if file.is_file()), None)  # one of them, or both, are there
    compared = f", {size / whole:.1%} of the checkpoint" if whole else ""
    return f"{out}: {counted(model.gaussians.count, 'Gaussian')}, {size / 1e6:.2f} MB{compared}"


def _animated(scene: MovingScene, out: Path, times: Times, content: Content) -> str:
    if content.kind == "mesh":
        raise InputError(f"{out}: a .glb stores points; the triangles of a mesh change over time; use a folder")
    wanted = [time for time, _, _, _ in chosen_times("export", times, scene.record, default="all")]
    count = write_animated_points(out, scene, wanted, content.least_opacity, content.taken_out)
    return f"{out}: {counted(count, 'point')} at {counted(len(wanted), 'time')}, {out.stat().st_size / 1e6:.2f} MB"


def _one_time(scene: MovingScene, out: Path, times: Times, content: Content) -> str:
    wanted = chosen_times("export", times if times.chosen else Times(frames="all"), scene.record)
    if times.chosen and len(wanted) > 1:
        raise InputError(f"{out}: a .ply file stores one time, not {len(wanted)}; use a folder, one time")
    count = _write(scene, out, wanted[0][0], content)
    return f"{out}: {count} {_parts(content)} at time {wanted[0][0]:g}, {out.stat().st_size / 1e6:.2f} MB"


def _every_time(scene: MovingScene, out: Path, times: Times, content: Content) -> str:
    wanted = chosen_times("export", times, scene.record, default="all")
    refuse_existing(out)
    scene.model  # raises for a run without a usable checkpoint, before any file is created  # noqa: B018
    out.absolute().parent.mkdir(parents=True, exist_ok=True)
    with replacing_folder(out) as target:
        for k, (time, _, _, _) in enumerate(wanted):
            _write(scene, target / f"{k:05d}.ply", time, content)
    names = "00000.ply" + (f" to {len(wanted) - 1:05d}.ply" if len(wanted) > 1 else "")
    return f"{out}: {counted(len(wanted), 'file')} of {_parts(content)}, {names}"


def _parts(content: Content) -> str:
    """The name of what a ply file contains."""
    return "triangles" if content.kind == "mesh" else content.kind


def _write(scene: MovingScene, file: Path, time: float, content: Content) -> int:
    """Write one ply file; returns the number of Gaussians, points or triangles."""
    unit = scene.record.unit
    axes = KEPT_AXES if scene.one_time else AXES
    comments = (f"endotsr {content.kind}", f"time {float(time)!r}", f"lengths in {unit}", axes)
    placement = scene.placement
    if content.kind == "mesh":
        found = surface(scene, time, content.voxel, content.taken_out)
        vertices = placed_points(found.vertices.T, placement).T
        write_ply(file, mesh_vertices(vertices, found.colours), comments, found.faces)
        return len(found.faces)
    placed = placed_scene(scene.at(time, content.taken_out), placement)
    vertices = point_vertices(placed, content.least_opacity) if content.kind == "points" else gaussian_vertices(placed)
    write_ply(file, vertices, comments)
    return vertices.size
