"""Rows of `inputs_tried.py` about stereo pairs: folders, side by side, squeezed and marked views, unlike views."""

from pathlib import Path

import numpy as np
from builders import builder
from input_kinds import MATRIX, MOVED, folder_of, pair, prepare, video, with_file
from input_rows import baseline, both, centred, refused, right, size, told
from made_videos import HEIGHT, WIDTH, files, picture, pictures, woven, write
from stereo_pairs import slanted_pair

from endotsr.cli.main import main
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.sequences.layouts import describe


@builder
def sides(folder: Path, left, right, tolerance=12.0) -> bool:
    """The written pairs are these."""
    clip = describe(folder / "o")
    return clip.count == len(left) == len(right) and all(
        np.abs(pair.left.astype(int) - one).mean() <= tolerance
        and np.abs(pair.right.astype(int) - other).mean() <= tolerance
        for pair, one, other in zip(clip.pictures(list(range(clip.count))), left, right)
    )


def exchanged_views(folder: Path) -> list[str]:
    """Depth of pairs whose left pictures are those of the right camera."""
    left, right, *_ = slanted_pair()
    for name, shown in zip(("left", "right"), (right, left)):
        files(folder / "clip", name, [np.roll(shown, k, axis=0) for k in range(3)], "jpg")
    height, width = left.shape[:2]
    lens = ("--camera", "300", "310", str(width / 2), str(height / 2))
    assert main(prepare("clip", "--baseline", "4", camera=lens)(folder)) == 0
    return ["depth", str(folder / "o")]


def doubled(frames: list[np.ndarray]) -> list[np.ndarray]:
    """Every picture beside itself."""
    return [np.hstack([shown, shown]) for shown in frames]


IN_TURN = [shown for i in range(6) for shown in (picture(i), np.roll(picture(i), -20, axis=1))]
BASELINE = ("--baseline", "4")
HALVES = ("--stereo", "side_by_side", *BASELINE)


@builder
def two_videos(folder: Path, right=MOVED) -> list[str]:
    """A folder with a video of each camera."""
    (folder / "clip").mkdir()
    for name, frames in (("left.mkv", pictures()), ("right.mkv", right)):
        write(folder / "clip" / name, frames, codec="ffv1", layout="bgr0")
    return prepare("clip", *BASELINE)(folder)


def marked_video(name: str, mark: str, *words: str, frames=None):
    """A video whose coded pictures (H.264) state a stereo pair."""
    return video(name, frames, *words, options={"x264-params": mark, "qp": "8"})


SIDE_BY_SIDE = [np.hstack([a, b]) for a, b in zip(pictures(), MOVED)]
STACKED = [np.vstack([a, b]) for a, b in zip(pictures(), MOVED)]


def squeezed(stacked: bool = False) -> list[np.ndarray]:
    """Pairs in pictures of the size of one view."""
    width, height = (WIDTH, HEIGHT // 2) if stacked else (WIDTH // 2, HEIGHT)
    join = np.vstack if stacked else np.hstack
    return [join([area_resize(view, width, height) for view in pair]) for pair in zip(pictures(), MOVED)]


@builder
def squeezed_video(folder: Path, *words: str, stacked: bool = False, mark: str = "") -> list[str]:
    """A video of squeezed pairs without loss, as Matroska.

    mark   of the pair; the size of the display is then that of one whole view, as the format states it
    """
    file = write(folder / "a.mkv", squeezed(stacked), codec="ffv1", layout="bgr0", stereo_mode=mark)
    data = file.read_bytes().replace(b"\x54\xb0\x81\x40", b"\x54\xb0\x81\x80", 1)  # width 64 to 128
    file.write_bytes(data.replace(b"\x54\xba\x81\x30", b"\x54\xba\x81\x60", 1))  # height 48 to 96
    return prepare("a.mkv", *BASELINE, *words)(folder)


@builder
def of_whole_views(folder: Path, *words: str) -> list[str]:
    """Squeezed pairs with the calibration of a whole view, which states its size."""
    text = f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_matrix: {{data: [{', '.join(MATRIX.split())}]}}\n"
    (folder / "a.yaml").write_text(text)
    return folder_of(squeezed(), "--calibration", str(folder / "a.yaml"), *BASELINE, *words, camera=())(folder)


def textured(i: int, shift: int = 0, down: int = 0) -> np.ndarray:
    """A picture of 256x192 whose texture moves."""
    rough = np.random.default_rng(1).integers(0, 255, (60, 100)).astype(np.uint8)
    whole = np.kron(rough, np.ones((4, 4)))[20 + down : 212 + down, 40 + shift + 4 * i : 296 + shift + 4 * i]
    return np.stack([whole, whole / 2, whole / 2], axis=2).astype(np.uint8)


@builder
def matched(folder: Path, right) -> list[str]:
    """`endotsr depth` on a pair of cameras whose right view is made by a function of the number of the frame."""
    main(pair(frames=([textured(i) for i in range(4)], [right(i) for i in range(4)]))(folder))
    return ["depth", str(folder / "o")]


pairs_kept, pairs_alike = sides(pictures(), MOVED, 0), sides(pictures(), MOVED)
whole = both(size(WIDTH, HEIGHT), pairs_alike)  # both views have their shape again
SIDE, STACK = ("--stereo", "half_side_by_side"), ("--stereo", "half_stacked")
STEREO_ROWS = [
    refused("stereo, a right picture missing", pair(frames=(pictures(), pictures(9))), "left holds 12 files"),
    right("stereo, two videos in a folder", two_videos(), pairs_kept),
    refused("stereo, two videos of unlike length", two_videos(right=MOVED[:9]), "count 9, of left.mkv 12"),
    right("stereo, --right with a folder", with_file("--right", "other", lambda path: files(path, ".", MOVED),
        *BASELINE), pairs_kept),
    right("stereo, left_frames/ and right_frames/", pair(names=("left_frames", "right_frames"), frames=(pictures(),
        MOVED)), pairs_kept),
    told("video, stereo that is not named", video("a.mp4", doubled(pictures())), "side by side, resemble each"),
    told("video, stereo, stacked, that is not named", video("a.mp4", [np.vstack([p, p]) for p in pictures()]),
        "stacked, resemble each other"),
    right("video, stereo, side by side", video("a.mp4", doubled(pictures()), *HALVES), both(sides(pictures(),
        pictures()), baseline(4))),
    refused("video, stereo, of odd width", video("a.mkv", [p[:, :127] for p in pictures()], *HALVES, codec="ffv1",
        layout="bgr0"), "even width"),
    told("video, left and right in turn", video("a.mp4", IN_TURN), "alternating-views"),
    told("video, side by side by a mark of H.264", marked_video("a.mp4", "frame-packing=3", *BASELINE,
        frames=SIDE_BY_SIDE), "states stereo pairs side by side: read as such", pairs_alike),
    told("video, stacked by a mark of H.264", marked_video("a.mkv", "frame-packing=4", *BASELINE, frames=STACKED),
        "states stereo pairs stacked: read as such", pairs_alike),
    told("video, a mark of a pair, --stereo none", marked_video("a.mp4", "frame-packing=3", "--stereo", "none",
        frames=SIDE_BY_SIDE), "--stereo none overrides it"),
    refused("video, a mark of alternating pictures", marked_video("a.mp4", "frame-packing=5"),
        "stereo pairs in alternating pictures"),
    told("video, interlaced, side by side", video("a.mp4", doubled(woven()), *HALVES, options={"flags": "+ildct+ilme",
        "x264-params": "interlaced=1:tff=1"}), "is interlaced"),
    told("stereo, views squeezed to half their width", squeezed_video("--stereo", "side_by_side"),
        "--stereo half_side_by_side restores it", size(WIDTH // 2, HEIGHT)),
    right("stereo, views squeezed to half their width, the remedy", squeezed_video(*SIDE), whole),
    told("stereo, views squeezed to half their height", squeezed_video("--stereo", "stacked", stacked=True),
        "--stereo half_stacked restores it", size(WIDTH, HEIGHT // 2)),
    right("stereo, views squeezed to half their height, the remedy", squeezed_video(*STACK, stacked=True), whole),
    told("stereo, views squeezed by the marks of the file", squeezed_video(mark="left_right"),
        "squeezed to half: restored; --stereo side_by_side keeps the pixels", whole),
    told("stereo, views squeezed in height by the marks of the file", squeezed_video(mark="top_bottom", stacked=True),
        "squeezed to half: restored; --stereo stacked keeps the pixels", whole),
    told("stereo, views squeezed by the marks of the file, --stereo side_by_side", squeezed_video("--stereo",
        "side_by_side", mark="left_right"), "pixels are 2 times as wide as high", size(WIDTH // 2, HEIGHT)),
    told("stereo, squeezed views in pictures", folder_of(squeezed(), *HALVES), "--stereo half_side_by_side restores it",
        size(WIDTH // 2, HEIGHT)),
    right("stereo, squeezed views in pictures, the remedy", folder_of(squeezed(), *SIDE, *BASELINE), whole),
    refused("stereo, squeezed views and the calibration of whole ones", of_whole_views("--stereo", "side_by_side"),
        "--stereo half_side_by_side restores them"),
    told("stereo, squeezed views and the calibration of whole ones, the remedy", of_whole_views(*SIDE),
        "half a pixel was added", both(whole, centred)),
    refused("stereo, left and right exchanged", exchanged_views, "with left and right exchanged"),
    told("stereo, a right view from 8 rows lower", matched(lambda i: textured(i, 12, 8)), "are the views rectified"),
    told("stereo, a right view from 2 rows lower", matched(lambda i: textured(i, 12, 2)), "unrectified-views"),
    told("stereo, a right view that stands still", matched(lambda i: textured(0, 12)), "frozen-right-view"),
    told("stereo, a right view that is dark", pair(frames=(pictures(), [p // 2 for p in pictures()])),
        "unequal-views"),
]  # fmt: skip
