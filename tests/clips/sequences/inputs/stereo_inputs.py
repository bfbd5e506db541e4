"""Rows of `inputs_tried.py` about stereo pairs: folders, side by side, squeezed and marked views, unlike views."""

from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import MATRIX, MOVED, Row, baseline, both, centred, folder_of, pair, prepare, size, video
from made_videos import HEIGHT, WIDTH, files, picture, pictures, woven, write
from stereo_pairs import slanted_pair

from endotsr.cli.main import main
from endotsr.clips.opencv.filters import area_resize
from endotsr.clips.opencv.pictures import write_jpeg
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


STEREO = [np.hstack([p, p]) for p in pictures()]


def exchanged_views(folder: Path) -> list[str]:
    """Depth of pairs whose left pictures are those of the right camera."""
    left, right, *_ = slanted_pair()
    pair(frames=([right] * 3, [left] * 3))(folder)
    moving = [[np.roll(p, k, axis=0) for k in range(3)] for p in (right, left)]
    for name, frames in zip(("left", "right"), moving):
        for k, shown in enumerate(frames):
            write_jpeg(folder / f"clip/{name}/{k:04d}.jpg", shown, 100)
            (folder / f"clip/{name}/{k:04d}.png").unlink()
    height, width = left.shape[:2]
    lens = ("--camera", "300", "310", str(width / 2), str(height / 2))
    assert main(prepare("clip", "--baseline", "4", camera=lens)(folder)) == 0
    return ["depth", str(folder / "o")]


IN_TURN = [shown for i in range(6) for shown in (picture(i), np.roll(picture(i), -20, axis=1))]


@builder
def two_videos(folder: Path, *words: str, names=("left.mkv", "right.mkv"), right=MOVED) -> list[str]:
    """A folder with a video of each camera."""
    (folder / "clip").mkdir()
    for name, frames in zip(names, (pictures(), right)):
        write(folder / "clip" / name, frames, codec="ffv1", layout="bgr0")
    return prepare("clip", "--baseline", "4", *words)(folder)


def second_video(folder: Path) -> list[str]:
    two_videos(names=("a.mkv", "b.mkv"))(folder)
    return prepare("clip/a.mkv", "--right", str(folder / "clip/b.mkv"), "--baseline", "4")(folder)


def second_folder(folder: Path) -> list[str]:
    for name, frames in (("one", pictures()), ("other", MOVED)):
        files(folder, name, frames)
    return prepare("one", "--right", str(folder / "other"), "--baseline", "4")(folder)


def two_folders(left: str, right: str):
    return pair(names=(left, right), frames=(pictures(), MOVED))


pairs_kept = sides(pictures(), MOVED, 0)


def marked_video(name: str, mark: str, *words: str, frames=None):
    """A video whose coded pictures (H.264) state a stereo pair."""
    return video(name, frames, *words, options={"x264-params": mark, "qp": "8"})


SIDE_BY_SIDE = [np.hstack([a, b]) for a, b in zip(pictures(), MOVED)]
STACKED = [np.vstack([a, b]) for a, b in zip(pictures(), MOVED)]
BASELINE = ("--baseline", "4")


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
    frames = squeezed(stacked)
    with av.open(str(folder / "a.mkv"), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "bgr0"
        if mark:
            stream.metadata["stereo_mode"] = mark
        for pixels in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode())
    data = (folder / "a.mkv").read_bytes()
    for old, new in ((b"\x54\xb0\x81\x40", b"\x54\xb0\x81\x80"), (b"\x54\xba\x81\x30", b"\x54\xba\x81\x60")):
        data = data.replace(old, new, 1)  # width 64 to 128, height 48 to 96
    (folder / "a.mkv").write_bytes(data)
    return prepare("a.mkv", "--baseline", "4", *words)(folder)


@builder
def of_whole_views(folder: Path, *words: str) -> list[str]:
    """Squeezed pairs with the calibration of a whole view, which states its size."""
    text = f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_matrix: {{data: [{', '.join(MATRIX.split())}]}}\n"
    (folder / "a.yaml").write_text(text)
    folder_of(squeezed())(folder)
    calibration = ("--calibration", str(folder / "a.yaml"), "--baseline", "4")
    return prepare("clip", *calibration, *words, camera=())(folder)


def whole(folder: Path) -> bool:
    """Both views have their shape again."""
    return size(WIDTH, HEIGHT)(folder) and sides(pictures(), MOVED)(folder)


SIDE, STACK = ("--stereo", "half_side_by_side"), ("--stereo", "half_stacked")
INTERLACED_PAIR = [np.hstack([p, p]) for p in woven()]


def textured(i: int, shift: int = 0, down: int = 0) -> np.ndarray:
    """A picture of 256x192 whose texture moves."""
    rough = np.random.default_rng(1).integers(0, 255, (60, 100)).astype(np.uint8)
    whole = np.kron(rough, np.ones((4, 4)))[20 + down : 212 + down, 40 + shift + 4 * i : 296 + shift + 4 * i]
    return np.stack([whole, whole / 2, whole / 2], axis=2).astype(np.uint8)


@builder
def matched(folder: Path, right) -> list[str]:
    """`endotsr depth` on a pair of cameras whose right view is made by a function of the number of the frame."""
    shown = [textured(i) for i in range(4)], [right(i) for i in range(4)]
    main(pair(frames=shown)(folder))
    return ["depth", str(folder / "o")]


STEREO_ROWS = [
    Row("stereo, a right picture missing", pair(frames=(pictures(), pictures(9))), "refused", "left holds 12 files"),
    Row("stereo, two videos in a folder", two_videos(), "right", "", pairs_kept),
    Row("stereo, two videos of unlike length", two_videos(right=MOVED[:9]), "refused", "count 9, of left.mkv 12"),
    Row("stereo, --right with a video", second_video, "right", "", pairs_kept),
    Row("stereo, --right with a folder", second_folder, "right", "", pairs_kept),
    Row("stereo, left_frames/ and right_frames/", two_folders("left_frames", "right_frames"), "right", "", pairs_kept),
    Row("stereo, left_rectified/ and right_rectified/", two_folders("left_rectified", "right_rectified"), "right", "",
        pairs_kept),
    Row("video, stereo that is not named", video("a.mp4", STEREO), "told", "side by side, resemble each"),
    Row("video, stereo, stacked, that is not named", video("a.mp4", [np.vstack([p, p]) for p in pictures()]), "told",
        "stacked, resemble each other"),
    Row("video, stereo, side by side", video("a.mp4", STEREO, "--stereo", "side_by_side", "--baseline", "4"), "right",
        "", both(sides(pictures(), pictures()), baseline(4))),
    Row("video, stereo, of odd width", video("a.mkv", [p[:, :127] for p in pictures()], "--stereo", "side_by_side",
        "--baseline", "4", codec="ffv1", layout="bgr0"), "refused", "even width"),
    Row("video, left and right in turn", video("a.mp4", IN_TURN), "told", "alternating-views"),
    Row("video, side by side by a mark of H.264", marked_video("a.mp4", "frame-packing=3", *BASELINE,
        frames=SIDE_BY_SIDE), "told", "states stereo pairs side by side: read as such", sides(pictures(), MOVED)),
    Row("video, stacked by a mark of H.264", marked_video("a.mkv", "frame-packing=4", *BASELINE, frames=STACKED),
        "told", "states stereo pairs stacked: read as such", sides(pictures(), MOVED)),
    Row("video, a mark of a pair, --stereo none", marked_video("a.mp4", "frame-packing=3", "--stereo", "none",
        frames=SIDE_BY_SIDE), "told", "--stereo none overrides it"),
    Row("video, a mark of alternating pictures", marked_video("a.mp4", "frame-packing=5"), "refused",
        "stereo pairs in alternating pictures"),
    Row("video, interlaced, side by side", video("a.mp4", INTERLACED_PAIR, "--stereo", "side_by_side", "--baseline",
        "4", options={"flags": "+ildct+ilme", "x264-params": "interlaced=1:tff=1"}), "told", "is interlaced"),
    Row("stereo, views squeezed to half their width", squeezed_video("--stereo", "side_by_side"), "told",
        "--stereo half_side_by_side restores it", size(WIDTH // 2, HEIGHT)),
    Row("stereo, views squeezed to half their width, the remedy", squeezed_video(*SIDE), "right", "", whole),
    Row("stereo, views squeezed to half their height", squeezed_video("--stereo", "stacked", stacked=True), "told",
        "--stereo half_stacked restores it", size(WIDTH, HEIGHT // 2)),
    Row("stereo, views squeezed to half their height, the remedy", squeezed_video(*STACK, stacked=True), "right", "",
        whole),
    Row("stereo, views squeezed by the marks of the file", squeezed_video(mark="left_right"), "told",
        "squeezed to half: restored; --stereo side_by_side keeps the pixels", whole),
    Row("stereo, views squeezed in height by the marks of the file", squeezed_video(mark="top_bottom", stacked=True),
        "told", "squeezed to half: restored; --stereo stacked keeps the pixels", whole),
    Row("stereo, views squeezed by the marks of the file, --stereo side_by_side", squeezed_video("--stereo",
        "side_by_side", mark="left_right"), "told", "pixels are 2 times as wide as high", size(WIDTH // 2, HEIGHT)),
    Row("stereo, squeezed views in pictures", folder_of(squeezed(), "--stereo", "side_by_side", "--baseline", "4"),
        "told", "--stereo half_side_by_side restores it", size(WIDTH // 2, HEIGHT)),
    Row("stereo, squeezed views in pictures, the remedy", folder_of(squeezed(), *SIDE, "--baseline", "4"), "right", "",
        whole),
    Row("stereo, squeezed views and the calibration of whole ones", of_whole_views("--stereo", "side_by_side"),
        "refused", "--stereo half_side_by_side restores them"),
    Row("stereo, squeezed views and the calibration of whole ones, the remedy", of_whole_views(*SIDE), "told",
        "half a pixel was added", lambda folder: whole(folder) and centred(folder)),
    Row("stereo, left and right exchanged", exchanged_views, "refused", "with left and right exchanged"),
    Row("stereo, a right view from 8 rows lower", matched(lambda i: textured(i, 12, 8)), "told",
        "are the views rectified"),
    Row("stereo, a right view from 2 rows lower", matched(lambda i: textured(i, 12, 2)), "told", "unrectified-views"),
    Row("stereo, a right view that stands still", matched(lambda i: textured(0, 12)), "told", "frozen-right-view"),
    Row("stereo, a right view that is mirrored", matched(lambda i: textured(i, 12)[:, ::-1].copy()), "told",
        "are the views rectified"),
    Row("stereo, a right view that is dark", pair(frames=(pictures(), [p // 2 for p in pictures()])), "told",
        "unequal-views"),
]  # fmt: skip
