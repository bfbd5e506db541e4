"""The common format: what is written is read, units and axes are exact, and every wrong file has one line."""

import re

import msgspec
import numpy as np
import pytest
from common_folder import FRAMES, HEIGHT, WIDTH, moving, write_plane, written
from scipy.spatial.transform import Rotation

from endotsr.cli.main import main
from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.depth_files import read_plane
from endotsr.clips.sequences.layouts import describe, layout_of, layouts
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.record import checked_record, record_of
from endotsr.clips.sequences.sequence_file import FILE_NAME, PoseEntry, read_sequence_file, write_sequence_file
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.config import PAPER, SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import camera_centre
from endotsr.training.runs.sources import input_record, load_sequence

WHOLE = SequenceConfig(depth_percentiles=(0.0, 100.0))


def test_the_file_is_read_as_it_was_written(tmp_path):
    found = written(tmp_path, poses=moving(), frame_rate=29.97, source='a "quoted" name')
    assert read_sequence_file(tmp_path) == found


def test_pictures_masks_depth_and_camera(tmp_path):
    written(tmp_path)
    sequence = read_sequence(tmp_path, WHOLE, 0.2)
    for i in range(FRAMES):
        np.testing.assert_array_equal(sequence.images[i], read_png(tmp_path / f"images/{i:06d}.png").transpose(2, 0, 1))
        np.testing.assert_array_equal(sequence.masks[i], read_png(tmp_path / f"masks/{i:06d}.png") == 0)
        stored = read_png(tmp_path / f"depth/{i:06d}.png")
        np.testing.assert_array_equal(sequence.depth[i], (stored * 0.01).astype(np.float32))
    assert sequence.static_camera and all(camera is sequence.cameras[0] for camera in sequence.cameras)
    assert sequence.cameras[0][2:] == (30.0, 33.0, 15.0, 13.0, WIDTH, HEIGHT) and sequence.unit == "mm"
    assert not camera_centre(sequence.cameras[0]).any()


def test_the_commands_detect_it_and_record_its_files(tmp_path):
    written(tmp_path)
    sequence = load_sequence(str(tmp_path), PAPER, SimulatorSettings())
    files = input_record(str(tmp_path), sequence, PAPER, SimulatorSettings())["files_sha256"]
    assert sorted(files)[-1] == FILE_NAME and len(files) == 1 + 3 * FRAMES
    assert layout_of(tmp_path).name == "common"


def test_layouts_have_names_of_their_own_and_the_most_general_is_last():
    names = [layout.name for layout in layouts()]
    assert len(set(names)) == len(names) and names[0] == "common"


@pytest.mark.parametrize(
    ("stated", "frames", "seconds"),
    [({"frame_rate": 25.0}, "", 0.2), ({"frame_rate": 25.0}, "1:", 0.16), ({"frame_rate": 25.0}, "::2", 0.24),
     ({}, "", 0), ({"frame_rate": 3.0, "times": [7.0, 7.2, 7.3, 7.8, 8.2]}, "", 1.5),
     ({"times": [0.0, 1.0, 2.0, 5.0, 6.0]}, "", 0)],
)  # fmt: skip
def test_the_seconds_of_a_recording_are_kept(stated, frames, seconds, tmp_path):
    """From time 0 to time 1: frame i shows the second `duration` times its time."""
    written(tmp_path, **stated)
    config = msgspec.structs.replace(WHOLE, frames=frames)
    record = record_of(read_sequence(tmp_path, config, 0.2))
    assert record.duration == pytest.approx(seconds)
    assert checked_record(msgspec.to_builtins(record), "a") == record
    if "times" in stated and seconds:
        np.testing.assert_allclose(np.multiply(record.times, seconds), np.subtract(stated["times"], 7.0), atol=1e-12)


def test_a_record_from_before_seconds_were_kept_is_read(tmp_path):
    written(tmp_path, frame_rate=25.0)
    data = msgspec.to_builtins(record_of(read_sequence(tmp_path, WHOLE, 0.2)))
    del data["duration"]
    assert checked_record(data, "a").duration == 0


def test_a_record_with_a_mirrored_camera_is_refused(tmp_path):
    written(tmp_path, frame_rate=25.0)
    data = msgspec.to_builtins(record_of(read_sequence(tmp_path, WHOLE, 0.2)))
    data["cameras"][0]["rotation"] = [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    with pytest.raises(InputError, match="cameras: 0: rotation: its rows are a mirror image"):
        checked_record(data, "a")


def test_without_masks_every_pixel_is_tissue(tmp_path):
    written(tmp_path, masks=False)
    sequence = read_sequence(tmp_path, WHOLE, 0.2)
    assert sequence.masks.all() and any("no masks" in note for note in sequence.notes)


def test_masks_may_be_left_out(tmp_path):
    written(tmp_path)
    assert read_sequence(tmp_path, SequenceConfig(masks="none"), 0.2).masks.all()


def test_jpeg_pictures(tmp_path):
    written(tmp_path)
    before = read_sequence(tmp_path, WHOLE, 0.2).images.astype(int)
    smooth = np.full((HEIGHT, WIDTH, 3), (180, 70, 60), np.uint8)
    for i, file in enumerate(sorted((tmp_path / "images").iterdir())):
        smooth[..., 0] = 180 - 2 * i + np.arange(WIDTH)  # a frame of one colour shows nothing
        write_jpeg(file.with_suffix(".jpg"), smooth)
        file.unlink()
    after = read_sequence(tmp_path, SequenceConfig(masks="none"), 0.2).images.astype(int)
    expected = np.broadcast_to(smooth.transpose(2, 0, 1), after.shape).copy()
    expected[:, 0] += 2 * (len(after) - 1 - np.arange(len(after), dtype=np.uint8))[:, None, None]
    assert after.shape == before.shape and np.abs(after - expected).max() <= 3


@pytest.mark.parametrize("ending", [".npy", ".tiff", ".pfm"])
def test_depth_in_other_files(tmp_path, ending):
    written(tmp_path)
    before = read_sequence(tmp_path, WHOLE, 0.2).depth
    for i, file in enumerate(sorted((tmp_path / "depth").iterdir())):
        plane = (before[i].astype(np.float64) / 0.01).astype(np.float32)
        plane[0, 0], plane[0, 1] = np.nan, -5.0
        write_plane(file.with_suffix(ending), plane)
        file.unlink()
    after = read_sequence(tmp_path, WHOLE, 0.2).depth
    assert not after[:, 0, :2].any()  # not a number and negative: no depth
    np.testing.assert_allclose(after[:, 1:], before[:, 1:], rtol=1e-6)


@pytest.mark.parametrize(("factor", "accepted"), [("-1", True), ("1.0", True), ("-0.003922", False), ("0.0", False)])
def test_a_scale_factor_of_pfm_is_refused(tmp_path, factor, accepted):
    order = "<f4" if factor.startswith("-") else ">f4"
    (tmp_path / "a.pfm").write_bytes(f"Pf\n3 2\n{factor}\n".encode() + np.arange(6, dtype=order).tobytes())
    if accepted:
        np.testing.assert_array_equal(read_plane(tmp_path / "a.pfm"), [[3, 4, 5], [0, 1, 2]])
        return
    with pytest.raises(InputError, match=r"a\.pfm: .*scale factor .*; use 1 or -1"):
        read_plane(tmp_path / "a.pfm")


@pytest.mark.parametrize(("unit", "factor"), [("um", 1e-3), ("cm", 10.0), ("m", 1000.0)])
def test_every_unit_becomes_millimetres(tmp_path, unit, factor):
    found = written(tmp_path / "a", poses=moving())
    assert found.depth and found.poses
    rows = [[v / factor if k % 4 == 3 else v for k, v in enumerate(row)] for row in found.poses.matrices]
    written(tmp_path / "b", unit=unit, poses=rows)
    other = read_sequence_file(tmp_path / "b")
    data = (tmp_path / "b" / FILE_NAME).read_text().replace("scale = 0.01", f"scale = {0.01 / factor!r}")
    (tmp_path / "b" / FILE_NAME).write_text(data.replace('[depth]\nfolder = "depth"\nunit = "mm"',
                                                         f'[depth]\nfolder = "depth"\nunit = "{unit}"'))  # fmt: skip
    assert other.unit == unit
    a, b = (read_sequence(tmp_path / name, WHOLE, 0.2) for name in "ab")
    np.testing.assert_allclose(a.depth, b.depth, rtol=1e-6)
    for first, second in zip(a.cameras, b.cameras):
        np.testing.assert_allclose(first.translation, second.translation, rtol=1e-12)


def test_directions_and_axes_say_the_same(tmp_path):
    """One camera written in four ways, each from its definition."""
    written(tmp_path)
    found = read_sequence_file(tmp_path)
    rotation = Rotation.from_euler("xyz", [0.2, -0.3, 0.4]).as_matrix()
    centre = np.array([3.0, -2.0, 5.0])
    flip = np.diag([1.0, -1.0, -1.0])
    ways = {
        ("world_to_camera", "opencv"): (rotation, -rotation @ centre),
        ("camera_to_world", "opencv"): (rotation.T, centre),
        ("world_to_camera", "opengl"): (flip @ rotation, -flip @ rotation @ centre),
        ("camera_to_world", "opengl"): (rotation.T @ flip, centre),
    }
    for (direction, axes), (matrix, place) in ways.items():
        rows = [np.column_stack([matrix, place]).ravel().tolist()] * FRAMES
        entry = PoseEntry(direction=direction, axes=axes, matrices=rows)
        data = type(found)(
            **{n: getattr(found, n) for n in ("format", "frames", "camera", "masks", "depth")}, poses=entry
        )
        write_sequence_file(data, tmp_path)
        camera = read_sequence(tmp_path, WHOLE, 0.2).cameras[0]
        np.testing.assert_allclose(camera.rotation, rotation, atol=1e-14)
        np.testing.assert_allclose(camera_centre(camera), centre, atol=1e-13)


def test_a_recording_of_the_folder_gives_the_same_frames(tmp_path):
    written(tmp_path, right=True, poses=moving())
    sequence, clip = read_sequence(tmp_path, WHOLE, 0.2), describe(tmp_path)
    pairs = list(clip.pictures([1, 3]))
    for i, pair in zip((1, 3), pairs, strict=True):
        np.testing.assert_array_equal(pair.left.transpose(2, 0, 1), sequence.images[i])
        assert pair.right is not None and clip.masks and clip.depth
        np.testing.assert_array_equal(clip.masks(i), sequence.masks[i])
        np.testing.assert_array_equal(clip.depth(i), sequence.depth[i])
    assert clip.baseline == 4.0 and clip.intrinsics == (30.0, 33.0, 15.0, 13.0, WIDTH, HEIGHT, ())


def text(path, old, new, count=1):
    file = path / FILE_NAME
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new, count))


WRONG = {
    "format": (lambda p: text(p, "sequence-1", "sequence-9"), "format = 'endotsr-sequence-9'.*allowed"),
    "not TOML": (lambda p: (p / FILE_NAME).write_text("format = "), "not valid TOML"),
    "unknown key": (lambda p: text(p, "fx =", "focal ="), "unknown key camera.focal; use one of"),
    "missing key": (lambda p: text(p, "fx = 30.0\n", ""), "camera.fx is missing"),
    "no camera": (lambda p: (p / FILE_NAME).write_text('format = "endotsr-sequence-1"\nframes = 5'), "camera is miss"),
    "focal length 0": (lambda p: text(p, "fx = 30.0", "fx = 0.0"), "camera.fx = 0.0 is not allowed; use a numb"),
    "focal length text": (lambda p: text(p, "fx = 30.0", 'fx = "a"'), "camera.fx = 'a' is not allowed"),
    "nan": (lambda p: text(p, "cx = 15.0", "cx = nan"), "camera.cx = nan is not allowed"),
    "principal point": (lambda p: text(p, "cx = 15.0", "cx = 960.0"), "principal point.*another picture size"),
    "distortion": (lambda p: text(p, "distortion = []", "distortion = [0.1, 0, 0, 0]"), "endotsr prepare"),
    "three coefficients": (lambda p: text(p, "distortion = []", "distortion = [0.1, 0, 0]"), "none, 4, 5 or 8"),
    "distortion text": (lambda p: text(p, "distortion = []", 'distortion = ["a"]'), "camera: a list of numbers"),
    "unit": (lambda p: text(p, 'unit = "mm"', 'unit = "inch"'), "unit = 'inch' is not allowed; use one of um, mm"),
    "one unit arbitrary": (lambda p: text(p, 'unit = "mm"', 'unit = "arbitrary"'), "depth.unit = 'mm' with unit"),
    "frames": (lambda p: text(p, "frames = 5", "frames = 6"), "frames = 6, but images/ holds 5"),
    "depth missing": (lambda p: (p / "depth/000002.png").unlink(), "depth: has no file for frame 2"),
    "mask missing": (lambda p: (p / "masks/000002.png").unlink(), "masks: has no file for frame 2"),
    "depth size": (lambda p: write_png(p / "depth/000002.png", np.ones((5, 6), np.uint16)), "000002.png: 6x5 pixels"),
    "image size": (lambda p: text(p, "width = 32", "width = 64"), "32x24 pixels, sequence.toml states 64x24"),
    "folder outside": (lambda p: text(p, 'folder = "depth"', 'folder = "../depth"'), "depth.folder = '../depth'"),
    "scale 0": (lambda p: text(p, "scale = 0.01", "scale = 0.0"), "depth.scale = 0.0 is not allowed"),
    "a pose too few": (lambda p: text(p, "    [1.0", "#"), "4 rows for 5 frames"),
    "a row too short": (lambda p: text(p, "    [1.0, 0.0,", "    [1.0,"), "frame 0: 11 numbers; use 12"),
    "no rotation": (lambda p: text(p, "    [1.0,", "    [2.0,"), "frame 0: the first three columns are not perp"),
    "mirror": (lambda p: text(p, "    [1.0,", "    [-1.0,"), "frame 0: .*mirror image"),
    "interpolated text": (lambda p: text(p, "interpolated = []", 'interpolated = "a"'), "interpolated = 'a' is not"),
    "pose text": (lambda p: text(p, "    [1.0,", '    ["a",'), "poses: a list of numbers"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_folder_has_one_line(tmp_path, case):
    damage, message = WRONG[case]
    written(tmp_path, poses=moving())
    damage(tmp_path)
    with pytest.raises(InputError, match=re.compile(message)) as caught:
        read_sequence(tmp_path, WHOLE, 0.2)
    assert str(tmp_path) in str(caught.value) and "\n" not in str(caught.value)


def test_without_depth_the_remedy_is_named(tmp_path):
    written(tmp_path / "stereo", depth=False, right=True)
    written(tmp_path / "mono", depth=False)
    with pytest.raises(InputError, match="`endotsr depth` makes it"):
        read_sequence(tmp_path / "stereo", WHOLE, 0.2)
    with pytest.raises(InputError, match=r"no depth.*one camera: endotsr depth --given FILES --kind relative"):
        read_sequence(tmp_path / "mono", WHOLE, 0.2)


def test_a_setting_overrides_the_polarity_of_inverted_masks(tmp_path):
    written(tmp_path)
    right = read_sequence(tmp_path, WHOLE, 0.2).masks
    for file in (tmp_path / "masks").iterdir():
        write_png(file, 255 - read_png(file))
    with pytest.raises(InputError, match="other polarity"):
        read_sequence(tmp_path, WHOLE, 0.2)
    sequence = read_sequence(tmp_path, SequenceConfig(excluded_value="black"), 0.2)
    np.testing.assert_array_equal(sequence.masks, right)
    assert any("overrides the value" in note for note in sequence.notes)


def test_a_wrong_statement_of_the_polarity_is_named_with_its_file(tmp_path, capsys):
    written(tmp_path)
    text(tmp_path, 'excluded_value = "white"', 'excluded_value = "black"')
    assert main(["check", str(tmp_path)]) == 1
    assert f'set [masks] excluded_value = "white" in {tmp_path / FILE_NAME}' in capsys.readouterr().out


def test_the_pictures_of_a_sequence_are_refused_with_the_folder_to_use(tmp_path, capsys):
    written(tmp_path / "clip")
    assert main(["train", str(tmp_path / "clip" / "images"), "--out", str(tmp_path / "run")]) == 2
    said = capsys.readouterr().err
    assert f"it is a part of the sequence {tmp_path / 'clip'}: use that folder" in said and "prepare" not in said
