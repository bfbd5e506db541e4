"""The lines of a trajectory file: `stamp tx ty tz qx qy qz qw` of TUM and EuRoC, the matrices of KITTI, or .npy.

A head line that names position and quaternion, or rotation vector, states the columns, in any order; without one, the
order is the one above. Lines that begin with # are comments. Matrices have no stamps: one per frame, in order.
"""

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from endotsr.clips.formats.camera import rows_of_motion
from endotsr.clips.formats.inventory import Inventory
from endotsr.clips.formats.plain_arrays import read_npy
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.untrusted.files import read_text
from endotsr.untrusted.names import decimal_commas, shown

COLUMNS = (7, 8, 12, 16)
ALLOWED = (
    "use 8 finite numbers, stamp tx ty tz qx qy qz qw; without stamps 7, or the 12 or 16 of a matrix, as KITTI has"
    " them; or other columns that a head line names"
)
LONGEST_HEAD = 4096  # characters; the search for brackets takes the square of it
OTHER_KINDS = {
    ".json": "JSON is not read here; write one line for each pose",
    ".xlsx": "a workbook is not read; save its sheet as CSV",
    ".xls": "a workbook is not read; save its sheet as CSV",
    ".ods": "a workbook is not read; save its sheet as CSV",
    ".npz": 'an archive of arrays is not read; write one of them with numpy.save("poses.npy", array)',
    ".mat": 'a MAT-file is not read; scipy.io.loadmat gives its arrays, and numpy.save("poses.npy", array) writes one',
    ".bag": "a ROS bag is not read; export the topic of the poses as text, as `rostopic echo -p` does",
}
MESSAGE = re.compile(r"(?:\w+\.)+(?=(?:position|orientation|translation|rotation)\.)")  # names of ROS before these
UNIT = re.compile(r"[xyz]\s*(?:[\[(]\s*|_)(um|mm|cm|m)\b")  # behind the name of a column, in lower case
NORM_TOLERANCE = 1e-2  # of a quaternion written with few digits
# Names in head lines, in lower case: the axis is the last letter, behind q, t, p or the words that stand for them.
QUATERNION = re.compile(r"(?:q|quat|quaternion|rot|orientation)(?:[._]\w*?)??[._]?([wxyz])")
# A rotation vector by its name alone: rx ry rz and rot_x are angles in as many programs.
VECTOR = re.compile(r"(?:rvec|rotvec|rotation_vector|axis_?angle|angle_?axis|rodrigues)[._]?([xyz012])")
UNCLEAR = re.compile(r"(?:r|rot|rotation|orientation)[._]?[xyz]")
POSITION = re.compile(r"(?:(?:t|p|pos|position|trans|translation)(?:[._]\w*?)??[._]?)?([xyz])|tvec[._]?([xyz012])")
FIELDS = Inventory(
    "the columns of a trajectory, as its head line names them",
    used={
        "stamp": "the first column: seconds, frame number, or nanoseconds as in EuRoC",
        "tx ty tz": "position",
        "qx qy qz qw": "unit quaternion, in the order of the head line or x y z w",
        "rvec_x rvec_y rvec_z": "rotation vector in radians, by a head line that names it rvec, rotvec or rodrigues",
    },
    harmless={"v_* b_* w_* vel* bias* gyro* acc*": "velocities and sensor biases follow from no picture"},
)
USED = ("tx", "ty", "tz", "qx", "qy", "qz", "qw")
OF_VECTORS = ("tx", "ty", "tz", "rvec_x", "rvec_y", "rvec_z")


class StoredPose(NamedTuple):
    """A pose as it is stored."""

    stamp: float
    rotation: FloatArray  # (3, 3)
    position: FloatArray  # (3,)
    where: str


class StoredPoses(NamedTuple):
    """The poses of a file."""

    rows: list[StoredPose]
    stamped: bool  # False: the stamps count from 0
    notes: list[str]
    unit: str = ""  # of the positions, if the head line states one


def stored_poses(path: Path) -> StoredPoses:
    """The poses of a file. Raises InputError naming the line and the reason."""
    if path.suffix.lower() == ".npy":
        lines, head, unit = _array_lines(path), [], ""
    else:
        if (why := OTHER_KINDS.get(path.suffix.lower())) is not None:
            raise InputError(f"{path}: {why}; {ALLOWED}")
        lines, head, unit = _text_lines(path)
    if not lines:
        raise InputError(f"{path}: holds no pose; {ALLOWED}")
    sizes = {len(row) for _, row in lines}
    if len(sizes) > 1:
        raise InputError(f"{path}: lines of {' and '.join(map(str, sorted(sizes)))} numbers; {ALLOWED}")
    if sizes & {12, 16} and {len(head)} != sizes:
        found = [StoredPose(k, *rows_of_motion(np.array(row).reshape(-1, 4), where), where)
                 for k, (where, row) in enumerate(lines)]  # fmt: skip
        return StoredPoses(found, False, [])
    names, notes = _columns_of(path, head, sizes.pop())
    place = [names.index(name) for name in (OF_VECTORS if "rvec_x" in names else USED)]
    stamp = names.index("stamp") if "stamp" in names else None
    found = []
    for k, (where, row) in enumerate(lines):
        position, quaternion = np.array([row[i] for i in place[:3]]), [row[i] for i in place[3:]]
        found.append(
            StoredPose(float(k) if stamp is None else row[stamp], _rotation(quaternion, where), position, where)
        )
    return StoredPoses(found, stamp is not None, notes, unit)


def _columns_of(path: Path, head: list[str], size: int) -> tuple[list[str], list[str]]:
    """The name of every column, and notes on the order and on columns that are not used.

    Raises:  InputError for a head line that names another number of columns.
    """
    if not head:
        return (["stamp"] if size == 8 else []) + list(USED), ["quaternions are read as x y z w"]
    if len(head) == 8 and size == 7 and head[0] == "stamp":  # a stamp that the lines do not have
        head = head[1:]
    if len(head) != size:
        raise InputError(f"{path}: its head line names {len(head)} columns, its lines have {size} numbers; {ALLOWED}")
    order = " ".join(name[1] for name in head if name in USED[3:])
    how = f"quaternions are {order}" if order else "rotations are vectors in radians"
    return head, [f"{how} by the head line", *FIELDS.noted(head, path)]


def _array_lines(path: Path) -> list[tuple[str, list[float]]]:
    """The rows of an array (n, 7 | 8 | 12 | 16), (n, 3, 4) or (n, 4, 4), with their place."""
    array = read_npy(path).astype(np.float64)
    rows = array.reshape(len(array), -1) if array.ndim in (2, 3) and len(array) else np.zeros((0, 0))
    if rows.shape[1] not in COLUMNS:
        raise InputError(f"{path}: array of shape {array.shape}; {ALLOWED}")
    if (lost := np.flatnonzero(~np.isfinite(rows).all(axis=1))).size:
        raise InputError(
            f"{path}: row {lost[0]}: holds a number that is not finite; such rows: {lost.size} of {len(rows)}; use"
            " finite numbers; where frames have no pose, a text file with stamps that leaves them out"
        )
    return [(f"{path}: row {i}", row) for i, row in enumerate(rows.tolist())]


def _text_lines(path: Path) -> tuple[list[tuple[str, list[float]]], list[str], str]:
    """Place and numbers of every line, the columns that a head line names, and its unit; it may have no mark."""
    found: list[tuple[str, list[float]]] = []
    head: list[str] = []
    unit = ""
    for number, line in enumerate(_text(path).splitlines(), 1):
        words, where = re.sub(r"[\[\],;\"]", " ", re.sub(r"(?<=\d)\s+#.*", "", line)).split(), f"{path}: line {number}"
        used = _used(words, head)
        row = _numbers(words, used)
        if not words or words[0].startswith("#") or (row is None and not found and _named_columns(line)):
            if named := _named_columns(line):
                head, unit = named, _stated_unit(line)
            else:
                _refuse_unclear(line, where)
            continue
        if row is None or len(row) not in (*COLUMNS, len(head)) or not np.isfinite(row).all():
            _refuse_unclear(line, where)
            raise InputError(f"{where}: {ALLOWED}{_no_number(words, used)}{decimal_commas(line)}{_angles(line)}")
        found.append((where, row))
    return found, head, unit


def _used(words: list[str], head: list[str]) -> list[bool]:
    """Whether each word of a line is of a column that is used; without a name for each, all are."""
    if len(head) != len(words):
        return [True] * len(words)
    return [k == 0 or name in USED + OF_VECTORS for k, name in enumerate(head)]


def _numbers(words: list[str], used: list[bool]) -> list[float] | None:
    """The numbers of a line, 0 for a column that is not used, such as the name of a frame; None if a word is none."""
    try:
        return [float(word) if needed else 0.0 for word, needed in zip(words, used, strict=True)]
    except ValueError:
        return None


def _stated_unit(line: str) -> str:
    """The unit that a head line states behind the names of the columns, such as `tx [mm]` or `tx_mm`; "" without."""
    stated = set(UNIT.findall(line.lower()))
    return stated.pop() if len(stated) == 1 else ""


def _no_number(words: list[str], used: list[bool]) -> str:
    """The end of a message about a line with a word that is no number in a column that is used; else nothing."""
    for word, needed in zip(words, used, strict=True):
        if needed and _numbers([word], [True]) is None:
            return f"; {shown(word)} is no number"
    return ""


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except InputError as error:
        raise InputError(f"{error}; use text in UTF-8, or one array in a file that ends in .npy") from None


def _angles(line: str) -> str:
    """The end of a message about a head line with angles; else nothing."""
    return "; angles are not read: write quaternions" if re.search("roll|pitch|yaw|euler", line.lower()) else ""


def _refuse_unclear(line: str, where: str) -> None:
    """Raise InputError for a head line with three columns of a rotation that may be angles or a rotation vector."""
    words = [word.strip().lower() for word in re.sub(r"\[[^\]]*\]|\([^)]*\)|[#\",;]", " ", line[:LONGEST_HEAD]).split()]
    named = [word for word in words if UNCLEAR.fullmatch(word)]
    if len(named) == 3 and sum(bool(POSITION.fullmatch(word)) for word in words) == 3:
        raise InputError(
            f"{where}: {' '.join(named)}: angles, or a rotation vector; angles are not read: write quaternions; name a"
            " rotation vector in radians rvec_x rvec_y rvec_z"
        )


def _named_columns(line: str) -> list[str]:
    """The columns that a line names: stamp, tx .. qw, others as they are; [] unless it names a pose."""
    if len(line) > LONGEST_HEAD:
        return []
    plain = re.sub(r"\[[^\]]*\]|\([^)]*\)|[#\"]", " ", line).replace(";", ",")
    words = [word.strip() for word in (plain.split(",") if "," in plain else plain.split())]
    found = []
    four = {word.lower() for word in words} >= {"rx", "ry", "rz", "rw"}  # a quaternion by its fourth number
    for k, word in enumerate(word for word in words if word):
        if four and word.lower() in ("rx", "ry", "rz", "rw"):
            found.append(f"q{word[1].lower()}")
            continue
        lower = re.sub(r"_(?:um|mm|cm|m)$", "", MESSAGE.sub("", re.sub(r"\s+", "_", word.lower())))
        if turned := QUATERNION.fullmatch(lower):
            found.append(f"q{turned[1]}")
        elif moved := POSITION.fullmatch(lower):
            found.append(f"t{_axis(moved[1] or moved[2])}")
        elif turned := VECTOR.fullmatch(lower):
            found.append(f"rvec_{_axis(turned[1])}")
        else:
            found.append(word if k else "stamp")
    return found if any(all(found.count(name) == 1 for name in names) for names in (USED, OF_VECTORS)) else []


def _axis(letter: str) -> str:
    return "xyz"[int(letter)] if letter.isdecimal() else letter


def _rotation(quaternion: list[float], where: str) -> FloatArray:
    """(3, 3) of a quaternion, or of a rotation vector (3,) in radians. Raises InputError for another length."""
    from scipy.spatial.transform import Rotation

    if len(quaternion) == 3:
        if (length := np.linalg.norm(quaternion)) > 2 * np.pi + NORM_TOLERANCE:
            raise InputError(f"{where}: the rotation vector has length {length:.4g}; use radians, 2 pi at most")
        return Rotation.from_rotvec(quaternion).as_matrix()
    length = np.linalg.norm(quaternion)
    if abs(length - 1) > NORM_TOLERANCE:
        raise InputError(f"{where}: the quaternion has length {length:.4g}; use 1, in the order x y z w")
    return Rotation.from_quat(quaternion).as_matrix()
