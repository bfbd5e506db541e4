"""The room that calls OpenCV."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from endotsr.clips.opencv.filters import area_resize, canny_edges
from endotsr.clips.opencv.flow import dense_flow, warp_cubic
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.opencv.regions import grown_by_disc
from endotsr.errors import InputError

RNG = np.random.default_rng(1)


def test_colours_are_red_green_blue(tmp_path):
    from PIL import Image

    Image.new("RGBA", (2, 1), (200, 100, 50, 255)).save(tmp_path / "a.png")
    assert read_png(tmp_path / "a.png").tolist() == [[[200, 100, 50]] * 2]


def test_a_cut_file_is_refused_at_every_length(tmp_path):
    write_png(tmp_path / "whole.png", RNG.integers(0, 255, (9, 9, 3)).astype(np.uint8))
    data = (tmp_path / "whole.png").read_bytes()
    for length in range(len(data)):
        (tmp_path / "cut.png").write_bytes(data[:length])
        with pytest.raises(InputError, match=r"cut.png: (truncated|not a) PNG"):
            read_png(tmp_path / "cut.png")


def test_a_missing_file_and_a_wrong_array_are_named(tmp_path):
    with pytest.raises(InputError, match=r"no.png: cannot be read"):
        read_png(tmp_path / "no.png")
    with pytest.raises(ValueError, match="float64"):
        write_png(tmp_path / "a.png", np.zeros((2, 2)))


def test_hard_D6_canny_saturates_instead_of_wrapping():
    depth = np.full((20, 20), 40.0)
    depth[:, 10:] = 300.0  # wraps to 44 by a plain cast: no edge
    edges = canny_edges(depth)
    assert edges.dtype == bool and edges[5, 8:12].any() and not edges[:, :7].any()
    depth[3, 3] = np.nan
    assert canny_edges(depth).shape == depth.shape
    assert not canny_edges(np.full((20, 20), 40.9)).any()


def test_flow_finds_a_shift_in_both_axes_with_its_sign():
    y, x = np.mgrid[0:64, 0:80]
    scene = lambda dx, dy: (
        (127 + 60 * np.sin((x - dx) / 5) + 60 * np.cos((y - dy) / 6 + (x - dx) / 20)).clip(0, 255).astype(np.uint8)
    )
    flow = dense_flow(scene(0, 0), scene(3, -2))
    assert flow.shape == (2, 64, 80)
    assert np.median(flow[0]) == pytest.approx(3, abs=0.3) and np.median(flow[1]) == pytest.approx(-2, abs=0.3)
    np.testing.assert_array_equal(dense_flow(scene(0, 0)[:8], scene(3, 0)[:8]), 0)


def test_area_resize_is_the_mean_of_what_is_covered():
    image = RNG.random((6, 8))
    np.testing.assert_allclose(area_resize(image, 4, 3), image.reshape(3, 2, 4, 2).mean(axis=(1, 3)))
    thirds = area_resize(RNG.random((3, 3)) * 0 + np.array([0.0, 3.0, 6.0]), 2, 3)
    np.testing.assert_allclose(thirds, [[1.0, 5.0]] * 3, atol=1e-6)
    with pytest.raises(ValueError, match="shrinks only"):
        area_resize(image, 9, 6)


def test_opencv_is_imported_on_first_use_only():
    code = "import sys, endotsr.clips.opencv.regions, endotsr.clips.sequences.read; sys.exit('cv2' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("quality", [60, 95])
@pytest.mark.parametrize("shape", [(33, 47, 3), (16, 9)])
def test_a_jpeg_has_the_pixels_that_opencv_decodes(shape, quality, tmp_path):
    import cv2

    pixels = cv2.GaussianBlur(RNG.integers(0, 255, shape, np.uint8), (0, 0), 2.0)
    cv2.imwrite(str(tmp_path / "a.jpg"), pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    stored = cv2.imread(str(tmp_path / "a.jpg"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.jpg"), stored[..., ::-1] if stored.ndim == 3 else stored)


def test_a_picture_of_more_pixels_than_allowed_is_refused_before_it_is_decoded(tmp_path):
    import struct

    import cv2

    data = bytearray(cv2.imencode(".jpg", np.zeros((16, 16, 3), np.uint8))[1].tobytes())
    place = data.index(b"\xff\xc0")
    data[place + 5 : place + 9] = struct.pack(">HH", 60000, 60000)
    (tmp_path / "a.jpg").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.jpg: 60000x60000 pixels; use at most 67108864"):
        read_picture(tmp_path / "a.jpg")


TOO_LARGE = """
import struct, sys
from pathlib import Path
from endotsr.errors import InputError
from endotsr.clips.opencv.pictures import read_picture
entries = [(256, 9000), (257, 9000), (258, 8), (259, 1), (262, 1), (273, 8), (278, 9000), (279, 81000000)]
tags = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries)
Path(sys.argv[1]).write_bytes(b"II*\\0" + struct.pack("<IH", 8, len(entries)) + tags + bytes(4))
try:
    read_picture(Path(sys.argv[1]))
except InputError as error:
    sys.exit(0 if "9000x9000 pixels; use at most 67108864" in str(error) else str(error))
sys.exit("read")
"""


def test_the_bound_on_pixels_holds_for_a_tiff(tmp_path):
    process = subprocess.run(
        [sys.executable, "-c", TOO_LARGE, str(tmp_path / "a.tiff")], check=False, capture_output=True, text=True
    )
    assert (process.returncode, process.stderr) == (0, "")


@pytest.mark.parametrize("pixels", [0, 0.5, 1, 1.5, 2, 6, 11.9, 12, 12.1, 20])
def test_a_grown_mask_holds_the_pixels_within_the_radius(pixels):
    mask = RNG.random((40, 53)) > 0.995
    mask[0, 0] = True
    y, x = np.nonzero(mask)
    rows, columns = np.indices(mask.shape)
    squared = ((rows[..., None] - y) ** 2 + (columns[..., None] - x) ** 2).min(axis=2)
    np.testing.assert_array_equal(grown_by_disc(mask, pixels), squared <= pixels**2)
    assert not grown_by_disc(np.zeros((5, 5), bool), pixels).any()


def test_the_bicubic_warp_is_the_kernel_of_keys_with_three_quarters():
    """Specification B14. OpenCV 4 rounds the position to 1/32 pixel, OpenCV 5 does not."""

    def kernel(s, a=-0.75):
        s = abs(s)
        return (a + 2) * s**3 - (a + 3) * s**2 + 1 if s < 1 else a * (s**3 - 5 * s**2 + 8 * s - 4) if s < 2 else 0.0

    impulse = np.zeros((9, 9), np.float32)
    impulse[4, 4] = 1
    for step in (1, 9, 16, 31):
        for nudge in (0, 0.01):
            flow = np.zeros((2, 9, 9), np.float32)
            flow[0] = (step + nudge) / 32
            rounded = int(cv2.__version__.split(".")[0]) < 5
            place = (step if rounded else step + nudge) / 32
            expected = [kernel(x + place - 4) for x in range(9)]
            np.testing.assert_allclose(warp_cubic(impulse, flow)[4], expected, atol=1e-6)
