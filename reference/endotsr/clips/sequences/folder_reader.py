"""The files of a folder that training reads directly: listed in time order, paired, and decoded on demand."""

from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

from numpy.typing import NDArray

from endotsr.clips.formats.files import check_pairing, list_pictures
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS, read_picture
from endotsr.clips.sequences.checks.kinds import Finding, finding, tried
from endotsr.clips.sequences.clip import Depth, Masks, Picture, PicturePair, colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import DEPTH_ENDINGS, depth_plane, read_plane
from endotsr.clips.sequences.mask_values import levels_of_set
from endotsr.clips.sequences.masks import tissue_masks
from endotsr.clips.sequences.unread import folders_of, together
from endotsr.errors import InputError

T = TypeVar("T")


class FolderReader:
    """Lists and decodes the files of a folder of one size. What cannot be listed is among `faults`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.images: list[Path] = []
        self.right: list[Path] = []  # empty: no stereo pairs
        self.faults: list[Finding] = []
        self.size: tuple[int, int] | None = None  # width and height of every file; None: unknown
        self.size_said = "the first image has"
        self.inside: dict[Path, tuple[str, ...]] = {}  # folders that were read, see `unread`

    def tried(self, make: Callable[[], T], code: str, where: object) -> T | None:
        """The value, or None with a fault."""
        return tried(self.faults, make, code, where)

    def list_pictures(self, left: str, right: str) -> None:
        """List the pictures, and the right ones if there is a folder for them."""
        self.images = self._listed(left, PICTURE_ENDINGS, "images")
        if (self.path / right).is_dir():
            self.right = self._listed(right, PICTURE_ENDINGS, "images")

    def masks(self, name: str, excluded_value: str, stated_in: str = "", proposed: bool = False) -> Masks | None:
        """The masks in a folder, one per frame; None with a fault."""
        folder = self.path / name
        if not folder.is_dir():
            what = f"{folder}: folder not found; a clip without masks is read with --sequence.masks none"
            self.faults.append(finding("masks-files", folder, what))
            return None
        files = self._listed(name, PICTURE_ENDINGS, "masks")

        def plane(i: int) -> NDArray:
            return grey_plane(self._sized(read_picture(files[i]), files[i]), files[i])

        levels = cache(lambda: levels_of_set(plane, files, folder))
        mask = lambda i: tissue_masks([plane(i)], [str(files[i])], excluded_value, levels=levels())[0]
        return Masks(mask, files, excluded_value, stated_in, proposed, levels=levels) if files else None

    def depth(self, name: str, scale: float) -> Depth | None:
        """The depth in a folder, one file per frame; None with a fault."""
        files = self._listed(name, DEPTH_ENDINGS, "depth")
        read = lambda i: depth_plane(self._sized(read_plane(files[i]), files[i]), scale, files[i])
        return Depth(read, files, scale) if files else None

    def pictures(self, wanted: list[int]) -> Iterator[PicturePair]:
        """The pictures of these frames."""
        for i in wanted:
            yield PicturePair(self._colour(self.images[i]), self._colour(self.right[i]) if self.right else None)

    def _listed(self, name: str, endings: tuple[str, ...], what: str) -> list[Path]:
        """The files of a folder, paired with the pictures; empty with a fault."""
        folder = self.path / name
        files = self.tried(partial(list_pictures, folder, endings), f"{what}-files", folder) or []
        self.inside = together(self.inside, folders_of(files, endings))
        if files and self.images:
            self.tried(partial(check_pairing, self.images, files), "pairing", folder)
        return files

    def _sized(self, pixels: NDArray, path: Path) -> NDArray:
        return pixels if self.size is None else of_size(pixels, path, self.size, self.size_said)

    def _colour(self, path: Path) -> Picture:
        return colour_picture(self._sized(read_picture(path), path), path)


def of_size(pixels: NDArray, path: Path, size: tuple[int, int], said: str) -> NDArray:
    """The pixels of a file. Raises InputError for another width and height than `size`, whose source is `said`."""
    if pixels.shape[1::-1] != size:
        raise InputError(
            f"{path}: {pixels.shape[1]}x{pixels.shape[0]} pixels, {said} {size[0]}x{size[1]}; use one size"
        )
    return pixels
