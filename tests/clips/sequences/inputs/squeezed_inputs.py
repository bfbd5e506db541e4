"""Rows of `inputs_tried.py` about stereo pairs whose views are squeezed to half their width or height."""

from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import MATRIX, Row, centred, folder_of, prepare, sides, size
from left_inputs import MOVED
from made_videos import HEIGHT, WIDTH, pictures

from endotsr.clips.opencv.filters import area_resize


def squeezed(stacked: bool = False) -> list[np.ndarray]:
    """Pairs in pictures of the size of one view."""
    width, height = (WIDTH, HEIGHT // 2) if stacked else (WIDTH // 2, HEIGHT)
    join = np.vstack if stacked else np.hstack
    return [join([area_resize(view, width, height) for view in pair]) for pair in zip(pictures(), MOVED)]


@builder
def video(folder: Path, *words: str, stacked: bool = False, mark: str = "") -> list[str]:
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
SQUEEZED_ROWS = [
    Row("stereo, views squeezed to half their width", video("--stereo", "side_by_side"), "told",
        "--stereo half_side_by_side restores it", size(WIDTH // 2, HEIGHT)),
    Row("stereo, views squeezed to half their width, the remedy", video(*SIDE), "right", "", whole),
    Row("stereo, views squeezed to half their height", video("--stereo", "stacked", stacked=True), "told",
        "--stereo half_stacked restores it", size(WIDTH, HEIGHT // 2)),
    Row("stereo, views squeezed to half their height, the remedy", video(*STACK, stacked=True), "right", "", whole),
    Row("stereo, views squeezed by the marks of the file", video(mark="left_right"), "told",
        "squeezed to half: restored; --stereo side_by_side keeps the pixels", whole),
    Row("stereo, views squeezed in height by the marks of the file", video(mark="top_bottom",
        stacked=True), "told", "squeezed to half: restored; --stereo stacked keeps the pixels", whole),
    Row("stereo, views squeezed by the marks of the file, --stereo side_by_side", video("--stereo", "side_by_side",
        mark="left_right"), "told", "pixels are 2 times as wide as high", size(WIDTH // 2, HEIGHT)),
    Row("stereo, squeezed views in pictures", folder_of(squeezed(), "--stereo", "side_by_side", "--baseline", "4"),
        "told", "--stereo half_side_by_side restores it", size(WIDTH // 2, HEIGHT)),
    Row("stereo, squeezed views in pictures, the remedy", folder_of(squeezed(), *SIDE, "--baseline", "4"), "right", "",
        whole),
    Row("stereo, squeezed views and the calibration of whole ones", of_whole_views("--stereo", "side_by_side"),
        "refused", "--stereo half_side_by_side restores them"),
    Row("stereo, squeezed views and the calibration of whole ones, the remedy", of_whole_views(*SIDE), "told",
        "half a pixel was added", lambda folder: whole(folder) and centred(folder)),
]  # fmt: skip
