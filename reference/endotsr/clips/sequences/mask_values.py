"""What the numbers of mask pictures mean, decided by all pictures of a folder or video together.

A frame without an instrument is black. Its picture in a JPEG or video holds small numbers from coding, and by itself
it resembles a picture of numbered objects. Other pictures of the set show which it is: coded masks reach white, pass
through grey at edges, and label pictures hold few numbers, each on whole areas.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.depth_stacks import ENDINGS
from endotsr.clips.sequences.sampling import even_frames
from endotsr.errors import InputError

MOST_SOFT_FRACTION = 0.05  # of a frame; a picture with more pixels between black and white is not a mask
LEAST_WHITE = 32  # the largest number of a set below this: numbers of objects, or two values
MOST_NUMBERS = 32  # different numbers in a set of labels; coding and smooth edges make more
DECIDED = 128  # a picture that reaches this number shows that small numbers are no objects, or are refused beside it
SAMPLED = 64  # pictures of a set that are read first
OBJECTS = "or with endotsr prepare --masks FOLDER --excluded-value nonzero the numbers of several objects"


class MaskLevels(NamedTuple):
    """The meaning of the numbers in a set of mask pictures."""

    black: int
    white: int
    graded: bool  # coded or smooth: numbers between are noise and edges, not objects

    @property
    def least(self) -> int:
        """The smallest number that counts as white."""
        return (self.black + self.white + 1) // 2

    @property
    def margin(self) -> int:
        """The distance from black or white within which a number is still black or white: an eighth."""
        return (self.white - self.black) // 8

    @property
    def named(self) -> str:
        """Black and white in words."""
        return f"{self.black} and {self.white}"


def numbers_of(plane: NDArray) -> set[int]:
    """The different numbers of a picture."""
    if plane.dtype == np.uint8:
        return set(np.flatnonzero(np.bincount(plane.ravel(), minlength=256)).tolist())
    return set(np.unique(plane).tolist())


def levels_of(values: Iterable[int], where: object, coded: bool = False) -> MaskLevels:
    """The meaning of the different numbers in all pictures of a set.

    coded    the pictures are stored with loss, see `is_coded`

    Two numbers of pictures without loss, the smaller at most half of the larger, are black and white. Otherwise black
    is 0, and white 1 where that is the largest number, 255, or 65535 where a number exceeds 255.

    Raises:  InputError for numbers of objects (the largest is 2 to 31), and for pictures that do not reach white.
    """
    found = sorted({int(value) for value in values})
    largest = found[-1] if found else 0
    if len(found) == 2 and not coded and 2 * found[0] <= largest and largest != 0:
        return MaskLevels(found[0], largest, graded=False)
    if largest <= 1:
        return MaskLevels(0, largest or 255, graded=False)
    white = 255 if largest <= 255 else 65535
    if largest < LEAST_WHITE:
        raise InputError(
            f"{where}: numbers up to {largest} in all pictures: use two values such as 0 and 255, {OBJECTS};"
            " without --masks, if these are empty masks with the noise of a codec"
        )
    if largest < (white + 1) // 2 and len(found) > 1:
        raise InputError(
            f"{where}: {len(found)} different values, the largest of all pictures is {largest}: use 0 and {white},"
            f" two values, {OBJECTS}"
        )
    near_white = any(white - white // 8 <= value < white for value in found)
    return MaskLevels(0, white, graded=coded or near_white or len(found) > MOST_NUMBERS)


def is_coded(file: Path) -> bool:
    """Whether a mask is stored with loss: a JPEG, or a picture of a video (`FILE/000003`)."""
    in_array = file.parent.suffix.lower() in ENDINGS
    return file.suffix.lower() in (".jpg", ".jpeg") or not (file.suffix or in_array)


def levels_of_set(read: Callable[[int], NDArray], files: list[Path], where: object) -> MaskLevels:
    """As `levels_of`, from up to 64 evenly spaced pictures of a set, and from others until one reaches `DECIDED`.

    read     the plane of a picture; an unreadable one is passed over, because its own reading reports it

    Raises:  InputError as `levels_of`.
    """
    count, values = len(files), set[int]()
    first = even_frames(count, SAMPLED)
    for k in [*first, *sorted(set(range(count)) - set(first))]:
        if k not in first and max(values, default=0) >= DECIDED:
            break
        try:
            values |= numbers_of(read(k))
        except InputError:
            continue
    return levels_of(values, where, any(map(is_coded, files)))


def white_pixels(
    plane: NDArray, levels: MaskLevels, name: object, out: NDArray[np.bool_] | None = None
) -> tuple[NDArray[np.bool_], int]:
    """The white pixels of one picture (H, W), and the number of pixels that are neither black nor white.

    Raises:  InputError for a picture with more than 5 % of its pixels farther than an eighth from black and white, with
             numbers that are not whole or above white, of 8 bits where white is 65535, and, unless the set is graded,
             with areas of another number.
    """
    refuse_parts(plane, name)
    white = np.greater_equal(plane, levels.least, out=out)
    exact = int(np.count_nonzero(plane == levels.black) + np.count_nonzero(plane == levels.white))
    if plane.max() > levels.white or (levels.white > 255 and plane.dtype == np.uint8):
        raise InputError(
            f"{name}: {8 * plane.dtype.itemsize}-bit picture with numbers up to {plane.max()}, while white is"
            f" {levels.white} in the others; use one scale and one bit depth"
        )
    if exact == plane.size:
        return white, 0
    between = np.count_nonzero((plane > levels.black + levels.margin) & (plane < levels.white - levels.margin))
    if between > MOST_SOFT_FRACTION * plane.size:
        raise InputError(
            f"{name}: {between / plane.size:.1%} of the pixels are neither {levels.black} nor {levels.white}: this is"
            f" not a mask (another kind of picture in the mask folder, or masks written with different scales?);"
            f" use the values {levels.named}, {OBJECTS}"
        )
    if not levels.graded:
        _refuse_areas(plane, levels, name)
    return white, plane.size - exact


def refuse_parts(plane: NDArray, name: object) -> None:
    """Raises InputError for a picture of numbers with a point that are not whole, such as probabilities."""
    if plane.dtype.kind != "f":
        return
    wrong = ~(plane == np.round(plane))  # NaN is not whole either
    if wrong.any():
        raise InputError(
            f"{name}: holds {plane[wrong][0]:g}; use whole numbers; a threshold, such as > 0.5, makes a mask of"
            " probabilities"
        )


def refuse_coded_objects(read: Callable[[int], NDArray], count: int, where: object) -> None:
    """Raises InputError for pictures whose numbers other than 0 are not objects alone: coded or smooth ones."""
    values: set[int] = set()
    for k in even_frames(count, SAMPLED):
        values |= numbers_of(read(k))
    if len(values) > MOST_NUMBERS:
        raise InputError(
            f"{where}: {len(values)} different numbers, as a JPEG, a video or smooth edges have them; with"
            f" --excluded-value nonzero all but 0 would be excluded; use at most {MOST_NUMBERS} numbers of objects"
        )


def _refuse_areas(plane: NDArray, levels: MaskLevels, name: object) -> None:
    """Raises InputError for an area of at least 3x3 pixels with one number that is neither black nor white."""
    odd = (plane != levels.black) & (plane != levels.white)
    same = odd[1:-1, 1:-1].copy()
    for y in range(3):
        for x in range(3):
            same &= plane[y : y + same.shape[0], x : x + same.shape[1]] == plane[1:-1, 1:-1]
    if same.any():
        number = int(plane[1:-1, 1:-1][same][0])
        raise InputError(
            f"{name}: areas of the number {number}, which is neither {levels.black} nor {levels.white}: an object, or a"
            f" mask on another scale? use {levels.named}, {OBJECTS}"
        )
