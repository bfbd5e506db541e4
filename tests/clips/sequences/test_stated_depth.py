"""`prepare --depth`: a disparity, an inverse or a stretched depth is not read as millimetres in silence."""

import numpy as np
import pytest
from made_videos import files, write
from raw_sources import colmap
from test_stereo_depth import slanted_pair

from endotsr.cli.main import main
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.read import read_sequence
from endotsr.config import PAPER, SequenceConfig

WIDTH, HEIGHT, FRAMES = 128, 96, 6
CAMERA = ["--camera", "100", "100", "64", "48"]
BASELINE = 5.0


def true_depth(i):
    """A wall of 40 to 70 mm that leans to the right and moves."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return 40 + 22 * x / WIDTH + 5 * y / HEIGHT + 2 * np.sin(y / 9 + i)


def lit_picture(i):
    """Tissue under the light of the scope, which falls with the square of the depth; a texture beside it."""
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    light = (40 / true_depth(i)) ** 2 * (1 + 0.1 * np.sin(x / 3 + 0.5 * i) * np.cos(y / 4))
    return np.clip(light[..., None] * np.array([200, 90, 70]), 0, 255).astype(np.uint8)


def recording(folder, values, name="depth", kind="npy"):
    """A clip.mp4 and a folder of depth files, one a frame."""
    write(folder / "clip.mp4", [lit_picture(i) for i in range(FRAMES)], options={"crf": "18"})
    (folder / name).mkdir()
    for i in range(FRAMES):
        plane = values(i)
        file = folder / name / f"{i:06d}.{kind}"
        np.save(file, plane.astype(np.float32)) if kind == "npy" else write_png(file, plane)
    return ["prepare", str(folder / "clip.mp4"), "--out", str(folder / "o"), *CAMERA, "--depth", str(folder / name)]


def disparity(i):
    return 100 * BASELINE / true_depth(i)


def scaled(values, top, kind):
    return (values / values.max() * top).astype(kind)


WRONG = {  # what the files hold: values, name of the folder, ending, what the message says
    "disparity in pixels": (lambda i: 4 * disparity(i), "depth", "npy", "increases with depth (rank correlation"),
    "relative inverse depth": (
        lambda i: 1800 / true_depth(i) - 3,
        "depth",
        "npy",
        "increases with depth (rank correlation",
    ),
    "disparity by its name": (lambda i: 4 * disparity(i), "disparity_raft", "npy", "indicates a disparity"),
    "a network by its name": (lambda i: true_depth(i), "depth_anything_v2", "npy", "indicates a disparity or a rel"),
    "stretched to 8 bits": (lambda i: scaled(true_depth(i), 255, np.uint8), "depth", "png", "of every frame is 255"),
    "stretched to 16 bits": (lambda i: scaled(true_depth(i), 65535, np.uint16), "depth", "png", "frame is 65535"),
    "stretched to 0 to 1": (lambda i: scaled(disparity(i), 1.0, np.float32), "depth", "npy", "of every frame is 1"),
    "disparity times 256": (lambda i: (disparity(i) * 256).astype(np.uint16), "depth", "png", "the median depth is"),
    "metres": (
        lambda i: true_depth(i) / 1000,
        "depth",
        "npy",
        "like metres; state another unit with --depth-unit",
    ),
}


@pytest.mark.parametrize("case", ["disparity in pixels", "stretched to 16 bits", "metres"])
def test_the_refusal_of_what_is_no_length_names_two_remedies(case, tmp_path, capsys):
    """What is said of each case is in `inputs_tried.py`."""
    values, name, kind, _ = WRONG[case]
    words = recording(tmp_path, values, name, kind)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "--kind disparity" in error and "--trust-depth" in error
    assert main([*words, "--trust-depth"]) == 0


def test_lengths_are_read(tmp_path):
    words = recording(tmp_path, lambda i: true_depth(i) / 1000)
    assert main([*words, "--depth-unit", "m"]) == 0
    config = SequenceConfig(depth_percentiles=(0.0, 100.0))
    sequence = read_sequence(tmp_path / "o", config, 0.2)
    np.testing.assert_allclose(sequence.depth[3], true_depth(3), atol=0.02)
    assert "depth-against-light" not in [found.code for found in check_sequence(tmp_path / "o", PAPER).findings]


def test_check_names_depth_that_the_light_contradicts(tmp_path):
    words = recording(tmp_path, lambda i: 4 * disparity(i))
    assert main([*words, "--trust-depth"]) == 0
    found = [found for found in check_sequence(tmp_path / "o", PAPER).findings if found.code == "depth-against-light"]
    assert found and found[0].level == "warning"


def test_the_parallax_of_a_pair_speaks_against_a_disparity(tmp_path, capsys):
    left, right, moved = slanted_pair()[:3]
    for name, picture in (("left", left), ("right", right)):
        files(tmp_path / "clip", name, [np.roll(picture, i, 0) for i in range(3)])
    (tmp_path / "depth").mkdir()
    for i in range(3):
        np.save(tmp_path / "depth" / f"{i:04d}.npy", np.roll(moved, i, 0).astype(np.float32))
    height, width = left.shape[:2]
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), "--baseline", "4"]
    words += ["--camera", "200", "200", str(width / 2), str(height / 2), "--depth", str(tmp_path / "depth")]
    assert main(words) == 2
    assert "depth decreases where the stereo pair is farther" in capsys.readouterr().err


def test_an_option_that_the_layout_does_not_read_is_refused(tmp_path, capsys):
    colmap(tmp_path / "model", False)
    (tmp_path / "d").mkdir()
    for option in (["--depth", str(tmp_path / "d")], ["--camera", "9", "9", "9", "9"], ["--baseline", "4"]):
        assert main(["prepare", str(tmp_path / "model"), "--out", str(tmp_path / "o"), *option]) == 2
        assert f"the layout colmap does not read {option[0]}; allowed: --masks" in capsys.readouterr().err
