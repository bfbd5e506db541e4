"""The poses that `endotsr poses` estimated, as one self-contained page."""

from collections.abc import Iterable

import numpy as np

from endotsr.clips.prepare.make_poses import EstimatedPoses, PoseReport
from endotsr.clips.prepare.make_structure import StructureReport
from endotsr.method.splatting.camera import Camera, camera_centre, degrees_between
from endotsr.results.report import parts
from endotsr.results.report.line_chart import ChartCurve, chart_svg


def poses_page(name: str, report: PoseReport, lines: list[str]) -> str:
    """The page as text: the sentences of the command, the path, and the quality of every frame."""
    sections = []
    if report.found is not None:
        sections = [
            parts.section("Path", _path(report.found.cameras, report.unit)),
            parts.section("Frames", _frames(report.found)),
            parts.section("Residual", _residual(report.found)),
        ]
    return _page("endotsr poses", name, report.written, lines, sections)


def structure_page(name: str, report: StructureReport, lines: list[str]) -> str:
    """The page of `endotsr poses --sfm` as text: its sentences, the path, and the points of every frame."""
    sections = []
    if (found := report.structure) is not None:
        seen = ChartCurve("points", [float(k) for k in range(len(found.seen))], [float(len(row)) for row in found.seen])
        charts = parts.figure("points of the reconstruction that a frame sees", _chart("points", [seen]))
        sections = [
            parts.section("Path", _path(list(report.cameras), report.unit)),
            parts.section("Frames", f'<div class="charts">{charts}</div>', _gaps(report.interpolated, report.held)),
        ]
    return _page("endotsr poses --sfm", name, report.written, lines, sections)


def _page(command: str, name: str, written: bool, lines: list[str], sections: list[str]) -> str:
    """What the pages of both commands have in common: the head and the sentences."""
    head = f"{name}: {'poses are written' if written else 'no poses are written'}"
    said = "".join(f"<p>{parts.text(line)}</p>" for line in lines)
    body = [f'<p class="eyebrow">{command}</p><h1>{parts.text(head)}</h1>', parts.section("Result", said), *sections]
    return parts.page(f"endotsr poses: {name}", "\n".join(part for part in body if part))


def _path(cameras: list[Camera], unit: str) -> str:
    """Position and turn of the scope against the first frame."""
    first, frames = cameras[0], [float(k) for k in range(len(cameras))]
    centres = np.array([first.rotation @ camera_centre(c) + first.translation for c in cameras])
    curves = [ChartCurve(f"{axis}, {unit}", frames, centres[:, k].tolist()) for k, axis in enumerate("xyz")]
    turns = [degrees_between(camera.rotation, first.rotation) for camera in cameras]
    charts = [
        parts.figure("position of the scope, axes of the first frame", _chart("position", curves)),
        parts.figure("angle to the first frame", _chart("angle", [ChartCurve("degrees", frames, turns)])),
    ]
    return f'<div class="charts">{"".join(charts)}</div>'


def _frames(found: EstimatedPoses) -> str:
    """Matches of every frame, and the frames that were interpolated."""
    links = [(float(k), link) for k, link in enumerate(found.estimate.links) if link is not None]
    frames = [k for k, _ in links]
    agreeing = ChartCurve("percent of the matches", frames, [100 * link.agreeing for _, link in links])
    left = ChartCurve("pixels left", frames, [link.left for _, link in links])
    flow = ChartCurve("pixels of flow", frames, [link.still for _, link in links])
    charts = parts.figure("matches that agree with one rigid motion", _chart("agreeing", [agreeing]))
    charts += parts.figure("first registration, against its source frame", _chart("left", [left, flow]))
    return f'<div class="charts">{charts}</div>{_gaps(found.interpolated, found.held)}'


def _gaps(interpolated: Iterable[int], held: Iterable[int]) -> str:
    """The frames without a pose of their own."""
    named = [("interpolated", interpolated), ("before the first or after the last pose", held)]
    return parts.definitions((text, ", ".join(map(str, frames)) or "none") for text, frames in named)


def _residual(found: EstimatedPoses) -> str:
    """The direct residual before and after the bundle adjustment."""
    e = found.estimate
    return parts.definitions(
        [
            ("robust scale of the residuals (B19) before", parts.cell(e.before.scale)),
            ("after", f"{parts.cell(e.after.scale)} local standard deviations"),
            ("agreeing points, before", parts.cell(e.before.agreeing)),
            ("after", parts.cell(e.after.agreeing)),
            ("pairs of frames", parts.cell(e.after.pairs)),
            ("returns to places seen before", parts.cell(len(e.returns))),
            ("pixels that the poses leave", f"{parts.cell(e.left)} of {parts.cell(e.still)}"),
        ]
    )


def _chart(title: str, curves: list[ChartCurve]) -> str:
    return chart_svg(title, curves, max((curve.x[-1] for curve in curves if curve.x), default=1.0), unit="frame")
