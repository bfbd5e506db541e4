"""The left pictures of a clip as a sequence whose items are decoded when they are asked for.

A round of drawing masks needs a few pictures, and the flows of all. Flows are kept under a fingerprint of the pictures.
That of the files needs no decoding; in a trial without a record it took about a thirtieth of the time of decoding.
"""

import hashlib
from collections.abc import Sequence
from typing import overload

import numpy as np

from endotsr.clips.sequences.clip import Clip, Picture
from endotsr.untrusted.files import in_threads, read_bytes
from endotsr.untrusted.png import LARGEST_FILE


class LeftPictures(Sequence[Picture]):
    """The left pictures (H, W, 3) uint8 of a clip with one file per frame. An item is decoded at each access."""

    def __init__(self, clip: Clip) -> None:
        self.clip = clip

    def __len__(self) -> int:
        return self.clip.count

    @overload
    def __getitem__(self, i: int) -> Picture: ...
    @overload
    def __getitem__(self, i: slice) -> list[Picture]: ...
    def __getitem__(self, i):
        if isinstance(i, slice):
            return [self[k] for k in range(len(self))[i]]
        return next(self.clip.pictures([range(len(self))[i]])).left


def left_pictures(clip: Clip) -> Sequence[Picture]:
    """The left pictures of all frames; those of a clip without a file per frame are decoded at once."""
    return LeftPictures(clip) if clip.images else [pair.left for pair in clip.pictures(list(range(clip.count)))]


def all_decoded(pictures: Sequence[Picture]) -> list[Picture]:
    """All pictures; those of files are decoded in several threads. Raises InputError for a file that is no picture."""
    found: dict[int, Picture] = {}
    in_threads(lambda i: found.update({i: pictures[i]}), len(pictures))
    return [found[i] for i in range(len(pictures))]


def fingerprint(pictures: Sequence[Picture], more: str) -> str:
    """SHA-256 (hex) of the pictures and of a text.

    Files stand for their pictures, together with the first picture itself: a crop of the same files differs.
    """
    if isinstance(pictures, LeftPictures):
        found = hashlib.sha256(f"{more} files {fingerprint([pictures[0]], more)}".encode())
        for file in pictures.clip.images:
            data = read_bytes(file, LARGEST_FILE)
            found.update(len(data).to_bytes(8, "little") + data)
        return found.hexdigest()
    found = hashlib.sha256(f"{more} {[picture.shape for picture in pictures]}".encode())
    for picture in pictures:
        found.update(np.ascontiguousarray(picture).data)
    return found.hexdigest()
