"""`endotsr prepare`: convert a recording to a folder in the common format."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.related_options import PREPARE
from endotsr.cli.parts.relations import check_relations
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.clips.formats.choices import (
    Axes,
    Border,
    DepthOfPoints,
    Direction,
    ExcludedValue,
    Gaps,
    Orientation,
    Other,
    Pairing,
    PictureKind,
    StatedStereo,
    Unit,
)
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

if TYPE_CHECKING:
    from endotsr.clips.sequences.sequence_file import SequenceFile
    from endotsr.clips.sequences.source_options import SourceOptions


@dataclass
class PrepareOptions:
    """Convert a recording to a folder for `endotsr train`: pictures, masks, depth and sequence.toml.

    SOURCE is a folder of pictures, a video, a folder in the layout of StereoMIS, SCARED, SERV-CT, Hamlyn, C3VD,
    EndoNeRF, COLMAP, nerfstudio, TUM or EuRoC, points of a reconstruction, or a folder in the common format. Options
    supply missing metadata. Lengths are converted to millimetres. The printed notes list all assumptions and changes.
    """

    source: Annotated[Path, Option("SOURCE", positional=True)]
    """folder, video or picture"""
    out: Annotated[Path, Option("FOLDER")]
    """folder to create"""
    layout: Annotated[str, Option("NAME")] = "auto"
    """layout of the source instead of the detected one"""
    stereo: StatedStereo = "auto"
    """stereo pairs in one picture: side_by_side = left on the left, stacked = left on top; half = squeezed to half"""
    right: Annotated[Path | None, Option("PATH")] = None
    """right view of a pair: a second video, or a folder of pictures"""
    right_late: Annotated[int, Option("N")] = 0
    """frames of the source by which the right view is late, negative: early; each pair is joined from one moment"""
    camera: Annotated[tuple[float, ...], Option("FX FY CX CY")] = ()
    """intrinsics in pixels; the centre of the first pixel is at (0.5, 0.5)"""
    field_of_view: Annotated[float | None, Option("DEGREES")] = None
    """in place of --camera: the angle from the left to the right border; square pixels, the axis in the centre"""
    distortion: Annotated[tuple[float, ...], Option("K ...")] = ()
    """distortion k1 k2 p1 p2 [k3 [k4 k5 k6]], in the order of OpenCV; pictures are undistorted"""
    calibration: Annotated[Path | None, Option("FILE")] = None
    """calibration of one camera or of a pair (is rectified): of StereoMIS, OpenCV, ROS, Kalibr, ORB-SLAM, EuRoC, KITTI,
    MATLAB or Bouguet's toolbox, or a matrix K"""
    baseline: float | None = None
    """baseline of an already rectified pair, millimetres"""
    trajectory: Annotated[Path | None, Option("FILE")] = None
    """poses: stamp tx ty tz qx qy qz qw as TUM and EuRoC have them, matrices of KITTI, or .npy"""
    trajectory_direction: Direction = "camera_to_world"
    """direction of the poses"""
    trajectory_axes: Axes | None = None
    """axes of the camera: opencv = right, down, forward; opengl = right, up, backward; llff = down, right, backward"""
    trajectory_unit: Unit | None = None
    """unit of the positions (--trajectory, TUM, EuRoC and StereoMIS: m, EndoNeRF: mm, nerfstudio: arbitrary)"""
    masks: Annotated[Path | None, Option("FOLDER")] = None
    """masks of another program, one per frame, one file for all frames, a video, or an array"""
    masks_late: Annotated[int, Option("N")] = 0
    """frames of the source by which the masks are late, negative: early; each picture gets the mask of its moment"""
    excluded_value: ExcludedValue = "white"
    """excluded value of these masks; white = from half of full white on, nonzero = the numbers of objects"""
    pairing: Pairing = "auto"
    """how masks and depth belong to frames: by number, by the number in the source of a prepared clip, or in order"""
    depth: Annotated[Path | None, Option("FOLDER")] = None
    """depth of every frame: png, tiff, npy, npz, mat or pfm; or one array of all frames"""
    depth_unit: Unit = "mm"
    """unit of the depth"""
    depth_scale: float = 1.0
    """size of one stored depth level, in the unit of the depth"""
    trust_depth: bool = False
    """read these files as metric depth even if they look like disparity or relative depth"""
    points: DepthOfPoints = "interpolated"
    """depth from the points of a reconstruction (COLMAP): interpolated, at the points only, or none"""
    model: Annotated[str, Option("NAME")] = ""
    """COLMAP model to read, such as sparse/1; without it, the one with the most pictures"""
    frames: Annotated[str, Option("A:B[:S],...")] = ""
    """frames or seconds of the source: 0:10,12,30s:45s"""
    drop: Annotated[str, Option("N,...")] = ""
    """frames or seconds to omit, such as 10,11"""
    crop: Annotated[tuple[int, ...], Option("X Y WIDTH HEIGHT")] = ()
    """crop of the pictures, source pixels; intrinsics are adapted"""
    unite_masks: Annotated[tuple[Path, ...], Option("FOLDER ...")] = ()
    """further masks, one per frame or one file for all frames; a pixel excluded by any mask is excluded"""
    rate: float | None = None
    """frames per second to keep"""
    source_rate: float | None = None
    """frames per second of the source, if its files do not state it"""
    orientation: Orientation | None = None
    """for a video with rotation metadata: rotate pictures, intrinsics, masks and depth as players do, or not"""
    scale: float = 1.0
    """image scale, by area averaging; intrinsics are adapted"""
    gaps: Gaps = "refuse"
    """single frames without mask or pose: drop omits them, fill interpolates"""
    border: Border = "auto"
    """dark border that all frames share, outside of the field of view; auto: excluded if the source has no masks"""
    pictures: PictureKind = "png"
    """format of the written pictures"""
    also: tuple[Other, ...] = ()
    """also describe the folder for other programs: transforms.json, or a COLMAP model in sparse/0"""
    replace: bool = False
    """replace FOLDER if it is from `prepare`; it may be the source"""
    json: JsonFile = None
    """also write the findings and notes as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(PrepareOptions, words, "prepare")
    from endotsr.clips.prepare.editing import cropped, united
    from endotsr.clips.prepare.prepare import PrepareSettings, prepare
    from endotsr.clips.sequences.layouts import describe
    from endotsr.clips.sequences.sequence_file import RIGHT

    _check_options(options, words)
    settings = PrepareSettings(
        options.frames, options.drop, options.rate, options.right_late, options.masks_late, options.scale,
        options.gaps, options.border, options.pictures, options.points,
    )  # fmt: skip
    clip = describe(options.source, _stated(options))
    _refuse_two_baselines(options, clip.calibration is not None)
    if options.unite_masks:
        clip = united(clip, options.unite_masks, _stated(options))
    if options.crop:
        clip = cropped(clip, options.crop)
    print(f"source: {options.source}, layout {clip.layout}, {counted(clip.count, 'frame')}", flush=True)
    found, notes = prepare(clip, options.out, settings, replace=options.replace)
    if options.also:
        from endotsr.clips.prepare.for_others import describe_for

        notes += describe_for(options.out, options.also)
    pair = (options.out / RIGHT).is_dir()
    if options.baseline is not None and not pair:
        notes.append("--baseline has no effect without right pictures: it is written, but nothing reads it")
    for note in notes:
        print(f"  {note}")
    camera = found.camera
    print(f"written: {options.out}, {counted(found.frames, 'frame')} of {camera.width}x{camera.height}")
    if any(note.startswith("warning: ") for note in notes):
        print(f"`endotsr check {shlex.quote(str(options.out))}` lists the remedy of each warning")
    print(_next_step(options.out, found, pair))
    write_result(
        options.json, source=options.source, layout=clip.layout, folder=options.out, frames=found.frames,
        width=camera.width, height=camera.height, stereo=camera.baseline > 0, depth=found.depth is not None,
        notes=list(notes),
    )  # fmt: skip
    return 0


def _check_options(options: PrepareOptions, words: list[str]) -> None:
    """Raises InputError for an existing output, for wrong numbers, and for options that do not go together."""
    from endotsr.clips.sequences.layouts import layout_of
    from endotsr.clips.sequences.sequence_file import FILE_NAME, WRITTEN
    from endotsr.training.runs.files import refuse_nested
    from endotsr.untrusted.writing import refuse_existing

    if not options.replace:
        remedy = ", or replace it with --replace" if (options.out / FILE_NAME).is_file() else ""
        refuse_existing(options.out, remedy)
    _check_numbers(options)
    if options.source.resolve() != options.out.resolve():  # with --replace they may be the same one
        refuse_nested(options.source, options.out, WRITTEN, f", or the source {options.out}")
    layout = layout_of(options.source, options.layout).name
    check_relations("prepare", PREPARE, options, given_names(PrepareOptions, words), {"layout": layout})


def _refuse_two_baselines(options: PrepareOptions, of_pair: bool) -> None:
    """Raises InputError for a baseline beside the calibration of a pair."""
    if options.baseline is not None and of_pair:
        raise InputError("prepare: --baseline with the calibration of a pair: it states the baseline; omit --baseline")


def _check_numbers(options: PrepareOptions) -> None:
    """Raises InputError for a number that is not positive, or intrinsics that are not four numbers."""
    for name in ("rate", "source_rate", "baseline", "depth_scale"):
        value = getattr(options, name)
        if value is not None and not 0 < value < float("inf"):
            raise InputError(f"--{name.replace('_', '-')} {value:g} is not allowed; use a number > 0")
    if len(options.camera) not in (0, 4):
        raise InputError(f"--camera: {len(options.camera)} numbers; use 4, FX FY CX CY")


def _stated(options: PrepareOptions) -> "SourceOptions":
    """The options on the source."""
    from endotsr.clips.sequences.source_options import SourceOptions

    same = (
        "layout", "stereo", "right", "field_of_view", "distortion", "calibration", "baseline", "trajectory",
        "trajectory_unit", "masks", "excluded_value", "pairing", "depth", "depth_unit", "depth_scale", "trust_depth",
        "orientation", "model",
    )  # fmt: skip
    return SourceOptions(
        **{name: getattr(options, name) for name in same},
        camera=options.camera or None,
        direction=options.trajectory_direction,
        axes=options.trajectory_axes,
        rate=options.source_rate,
    )


def _next_step(out: Path, found: "SequenceFile", pair: bool) -> str:
    """The command that comes next, or why there is none; `pair`: the clip has right pictures."""
    from endotsr.cli.parts.next_step import obstacle, training_step

    folder, stereo = shlex.quote(str(out)), found.camera.baseline > 0  # as a shell takes it
    if found.depth is not None or obstacle(found):
        return training_step(out, found)
    if pair and not stereo:
        from endotsr.clips.sequences.sequence_file import FILE_NAME

        return (
            "next: set the baseline of the two cameras, [camera] baseline in"
            f" {out / FILE_NAME} (or prepare --baseline MM), then endotsr depth {folder}"
        )
    if stereo and pair:
        return f"next: endotsr depth {folder}"
    if found.poses is not None:  # they fix the scale of the depth
        return (
            f"next: endotsr depth {folder} --given FILES --kind depth (in the unit of the poses), or endotsr poses"
            f" {folder} --sfm --replace (other poses, with the depth of points); training needs depth"
        )
    return (
        f"next: endotsr poses {folder} --sfm (a moving camera), or endotsr depth {folder} --given FILES --kind relative"
        " (inverse depth of a network), or --flat; training needs depth"
    )
