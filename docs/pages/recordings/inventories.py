"""Write the tables of the fields of file formats, of related options and of findings in docs/guides.

    python docs/make.py recordings.inventories

The tables are the inventories beside the readers, the relations of the commands and the kinds of findings of `endotsr
check`; nothing is measured.
"""

from collections import Counter
from collections.abc import Iterable

from endotsr.cli.parts.related_options import RELATIONS
from endotsr.cli.parts.relations import Needs, shown
from endotsr.clips.formats.calibration_fields import FLAT, INI, KALIBR, OPENCV, ROS
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.formats.matlab_calibrations import BOUGUET
from endotsr.clips.formats.matlab_calibrations import CAMERA as MATLAB
from endotsr.clips.formats.matlab_calibrations import PAIR as MATLAB_PAIR
from endotsr.clips.formats.picture_fields import BMP, JPEG, PNG, TIFF, WEBP
from endotsr.clips.formats.point_files import CLOUD
from endotsr.clips.formats.pose_fields import COLMAP_CAMERA, COLMAP_IMAGE, COLMAP_POINT, LLFF
from endotsr.clips.formats.slam_calibrations import EUROC, ORB
from endotsr.clips.formats.stream_marks import AVI, PROGRAM, TRANSPORT
from endotsr.clips.formats.trajectory_lines import FIELDS as TRAJECTORY
from endotsr.clips.formats.video_marks import MATROSKA, MP4
from endotsr.clips.sequences.checks.kinds import KINDS
from endotsr.clips.sequences.depth_files import FILES as DEPTH
from endotsr.clips.sequences.layouts import c3vd, hamlyn, scared, servct
from endotsr.clips.sequences.layouts.nerfstudio import FIELDS, FRAME_FIELDS
from endotsr.results.export.ply import GAUSSIAN
from endotsr.results.report.tables import markdown
from pages.store.program import Program

INVENTORIES = (
    FIELDS, FRAME_FIELDS, COLMAP_CAMERA, COLMAP_IMAGE, COLMAP_POINT, LLFF, TRAJECTORY, KALIBR, ROS, OPENCV, FLAT, INI,
    ORB, EUROC, MATLAB, MATLAB_PAIR, BOUGUET, servct.FILES, servct.CAMERA, hamlyn.FILES, c3vd.FILES,
    scared.FILES, scared.FRAME, PNG, JPEG, WEBP, TIFF, BMP, MP4, MATROSKA, AVI, TRANSPORT, PROGRAM, DEPTH, CLOUD,
    GAUSSIAN,
)  # fmt: skip
USES = {"used": "used", "refused": "refused", "told": "named in a note", "harmless": "harmless"}
COMMANDS = ("prepare", "depth", "render", "export")  # of `train`, most related options are settings


def fields(inventories: tuple[Inventory, ...] = INVENTORIES) -> str:
    """Every listed field of every format: used, refused, named in a note or harmless."""
    rows = []
    for inventory in inventories:
        for use, words in USES.items():
            for names, text in getattr(inventory, use).items():
                shown = [name.rstrip("_") for name in names.split()]
                rows.append([inventory.about, _code(shown), words, text.replace("|", "/")])
    return markdown(("Format", "Field", "Use", "Meaning or reason"), rows)


def options() -> str:
    """Every relation of the options of `COMMANDS`."""
    rows = []
    for command in COMMANDS:
        for relation in RELATIONS[command]:
            how = "needs one of" if isinstance(relation, Needs) else "excludes"
            rows.append(
                [command, _code(map(shown, relation.first)), how, _code(map(shown, relation.second)), relation.why]
            )
    return markdown(("Command", "Option", "Relation", "Other option", "Reason"), rows)


def findings() -> str:
    """How many kinds of findings there are, and each with its level, reason and remedy."""
    of = Counter(kind.level for kind in KINDS.values())
    numbers = f"{of['refusal']} refusals, {of['warning']} warnings and {of['note']} notes"
    rows = [(_code([code]), kind.level, kind.why, kind.remedy) for code, kind in KINDS.items()]
    table = markdown(("Finding", "Level", "Why it matters", "Remedy"), rows)
    return f"There are {len(KINDS)} findings: {numbers}.\n\n{table}"


def _code(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


PAGES = ("guides/fields.md", "guides/checks.md")
PROGRAM = Program(__name__, PAGES, {"fields": fields, "options": options, "findings": findings})
