"""`endotsr prepare`: every layout becomes the common format with the right cameras, and nothing is half-written."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from common_folder import moving, written
from made_videos import files
from raw_sources import HEIGHT, WIDTH, colmap, ini, scene_picture, stereomis, tum, write_video
from scipy.spatial.transform import Rotation

from endotsr.cli.main import main
from endotsr.cli.masks import carrying_command
from endotsr.clips.formats.camera import intrinsics_of_matrix
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.opencv.stereo import rectification_maps
from endotsr.clips.prepare.prepare import PrepareSettings, prepare
from endotsr.clips.prepare.straighten import straightener
from endotsr.clips.sequences.depth_files import step_of_depth
from endotsr.clips.sequences.layouts import describe, layout_of
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import read_sequence_file
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.config import SequenceConfig
from endotsr.errors import InputError
from endotsr.method.splatting.camera import camera_centre

WHOLE = SequenceConfig(depth_percentiles=(0.0, 100.0), allow_tissue_fraction=True)
CAMERA = (60.0, 61.0, 30.0, 25.0)


def prepared(source, out, settings=PrepareSettings(), **options):  # noqa: B008
    found, notes = prepare(describe(source, SourceOptions(**options)), out, settings)
    assert not [p for p in out.parent.iterdir() if p.name.startswith(".")]
    return found, notes


def test_a_lossless_video_gives_the_pictures_it_was_made_of(tmp_path):
    write_video(tmp_path / "clip.avi", [scene_picture(i) for i in range(6)])
    settings = PrepareSettings(frames="1:6:2")
    found, _ = prepared(tmp_path / "clip.avi", tmp_path / "out", settings, camera=CAMERA)
    assert found.frames == 3 and found.frame_rate == 12.5 and found.times is None
    for k, i in enumerate((1, 3, 5)):
        np.testing.assert_allclose(read_png(tmp_path / f"out/images/{k:06d}.png"), scene_picture(i), atol=2)


@pytest.mark.parametrize("stated", ["baseline", "calibration"])
def test_a_baseline_in_metres_is_named(tmp_path, stated):
    both = np.stack([np.hstack([scene_picture(i), scene_picture(i, 3.0)]) for i in range(3)])
    files(tmp_path, "clip", both)
    (tmp_path / "scope.ini").write_text(ini(translation=(-0.004, 0.0, 0.0)))
    of_pair = {"calibration": tmp_path / "scope.ini"}
    known = {"camera": CAMERA, "baseline": 0.004} if stated == "baseline" else of_pair
    _, notes = prepared(tmp_path / "clip", tmp_path / "out", stereo="side_by_side", **known)
    said = [note for note in notes if "baseline-unit" in note]
    assert len(said) == 1 and "0.004 mm apart; it looks like metres" in said[0]
    (tmp_path / "scope.ini").write_text(ini())
    known = {"camera": CAMERA, "baseline": 4.0} if stated == "baseline" else of_pair
    _, notes = prepared(tmp_path / "clip", tmp_path / "right", stereo="side_by_side", **known)
    assert "baseline-unit" not in " ".join(notes)


def test_the_calibration_of_a_pair_beside_pictures_of_one_view_is_named(tmp_path):
    files(tmp_path, "clip", [np.hstack([scene_picture(i), scene_picture(i, 3.0)]) for i in range(3)])
    (tmp_path / "scope.ini").write_text(ini())
    stated = {"calibration": tmp_path / "scope.ini"}
    _, notes = prepared(tmp_path / "clip", tmp_path / "pair", stereo="side_by_side", **stated)
    assert "that of a pair" not in " ".join(notes)
    files(tmp_path, "left", [scene_picture(i) for i in range(3)])
    _, notes = prepared(tmp_path / "left", tmp_path / "one", **stated)
    said = [note for note in notes if note.startswith("the calibration is that of a pair")]
    assert len(said) == 1 and "--stereo side_by_side" in said[0] and "--right FILE" in said[0]


def test_a_recording_without_intrinsics_is_told_of_the_calibration_beside_it(tmp_path):
    write_video(tmp_path / "clip.avi", [scene_picture(i) for i in range(3)])
    for name, said in (("other.ini", r"right border$"), ("Calibration.ini", r"a calibration: .*/Calibration\.ini$")):
        (tmp_path / name).write_text(ini())
        with pytest.raises(InputError, match=said):
            prepared(tmp_path / "clip.avi", tmp_path / "out")


def test_the_command_names_the_way_to_replace_its_folder_and_to_the_remedies(tmp_path, capsys):
    files(tmp_path, "clip", [scene_picture(i) * (i != 1) for i in range(3)])
    out = str(tmp_path / "out")
    words = ["prepare", str(tmp_path / "clip"), "--out", out, "--field-of-view", "60"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "warning: black-frame" in said and f"`endotsr check {out}` lists the remedy of each warning" in said
    assert main(words) == 2
    assert capsys.readouterr().err.endswith("exists already; choose another --out, or replace it with --replace\n")
    assert main([*words, "--replace", "--drop", "1"]) == 0
    said = capsys.readouterr().out
    assert "warning: " not in said and "lists the remedy" not in said
    (tmp_path / "foreign").mkdir()
    (tmp_path / "foreign" / "a").write_text("a")
    assert main([*words[:3], str(tmp_path / "foreign"), *words[4:]]) == 2
    assert capsys.readouterr().err.endswith("exists already; choose another --out\n")


@pytest.mark.parametrize(("stereo", "join"), [("side_by_side", np.hstack), ("stacked", np.vstack)])
def test_halves_of_a_stereo_picture(tmp_path, stereo, join):
    files(tmp_path, "clip", [join([scene_picture(i), scene_picture(i, 5.0)]) for i in range(3)])
    found, _ = prepared(tmp_path / "clip", tmp_path / "out", camera=CAMERA, stereo=stereo, baseline=4.0)
    assert (found.camera.width, found.camera.height, found.camera.baseline) == (WIDTH, HEIGHT, 4.0)
    np.testing.assert_array_equal(read_png(tmp_path / "out/images/000002.png"), scene_picture(2))
    np.testing.assert_array_equal(read_png(tmp_path / "out/images_right/000002.png"), scene_picture(2, 5.0))


@pytest.mark.parametrize("names", [("left", "right"), ("early_left", "early_right", "late_left", "late_right")])
def test_pairs_whose_names_have_no_number(tmp_path, names):
    """Left and right differ in their side alone; this counted as a missing partner."""
    (tmp_path / "clip").mkdir()
    for k, name in enumerate(names):
        write_png(tmp_path / "clip" / f"{name}.png", scene_picture(k))
    found, _ = prepared(tmp_path / "clip", tmp_path / "out", camera=CAMERA, baseline=4.0)
    assert found.frames == len(names) // 2 and found.depth is None and found.masks is None
    assert describe(tmp_path / "out").intrinsics == (*CAMERA, WIDTH, HEIGHT, ())
    for k in range(len(names)):
        place = tmp_path / "out" / ("images_right" if k % 2 else "images") / f"{k // 2:06d}.png"
        np.testing.assert_array_equal(read_png(place), scene_picture(k))


def test_resizing_moves_the_camera_along(tmp_path):
    written(tmp_path / "a", right=True, poses=moving())
    prepared(tmp_path / "a", tmp_path / "b", PrepareSettings(scale=0.75))
    whole, half = (describe(tmp_path / name) for name in "ab")
    assert half.intrinsics and whole.intrinsics and half.intrinsics[:6] == tuple(np.array(whole.intrinsics[:6]) * 0.75)
    assert half.baseline == whole.baseline and half.poses and whole.poses
    np.testing.assert_array_equal(half.poses[3].translation, whole.poses[3].translation)
    same = read_sequence(tmp_path / "a", SequenceConfig(scale=0.75), 0.2)
    ours = read_sequence(tmp_path / "b", SequenceConfig(), 0.2)
    np.testing.assert_array_equal(same.images, ours.images)
    np.testing.assert_array_equal(same.masks, ours.masks)
    np.testing.assert_allclose(same.depth, ours.depth, atol=0.01)


@pytest.mark.parametrize("scale", [0.75, 0.7])
def test_depth_is_reduced_as_a_training_reduces_it(tmp_path, scale):
    """An outlier is clipped before it is averaged into its neighbours; the arrays are those of `sequence.scale`."""
    written(tmp_path / "a", poses=moving())
    for file in (tmp_path / "a/depth").iterdir():
        plane = read_png(file)
        plane[20, 25] = 60000  # 600 mm among 40 to 60
        write_png(file, plane)
    prepared(tmp_path / "a", tmp_path / "b", PrepareSettings(scale=scale))
    whole = read_sequence(tmp_path / "a", SequenceConfig(scale=scale), 0.2)
    clip = describe(tmp_path / "a")
    straight = straightener(clip, 32, 24, scale)
    for i in range(whole.count):
        np.testing.assert_array_equal(straight.depth(clip.depth(i)), whole.depth[i])  # pyright: ignore
    reduced = read_sequence(tmp_path / "b", SequenceConfig(), 0.2)
    step = read_sequence_file(tmp_path / "b").depth.scale  # pyright: ignore[reportOptionalMemberAccess]
    np.testing.assert_allclose(reduced.depth, whole.depth, rtol=0, atol=0.51 * step)
    assert reduced.depth.max() < 61 and any("when it was resized, and not again" in note for note in reduced.notes)
    prepared(tmp_path / "b", tmp_path / "c")
    np.testing.assert_allclose(
        read_sequence(tmp_path / "c", SequenceConfig(), 0.2).depth, reduced.depth, atol=1.01 * step
    )


def test_rectified_rows_correspond_and_each_camera_has_its_own_distortion():
    """Points projected by OpenCV's own model with both lenses; the maps lead from the rectified place to them."""
    left, right = (-0.2, 0.05, 0.001, -0.002, 0.0), (0.15, -0.04, -0.001, 0.003, 0.01)
    rotation = Rotation.from_euler("xyz", [0.03, -0.02, 0.01]).as_matrix()
    translation = np.array([-4.0, 0.2, -0.1])
    matrices = (
        np.array([[160.0, 0, 81], [0, 161, 58], [0, 0, 1]]),
        np.array([[165.0, 0, 79], [0, 163, 62], [0, 0, 1]]),
    )
    maps = rectification_maps(matrices, (np.array(left), np.array(right)), rotation, translation, 160, 120)
    assert maps.baseline == pytest.approx(np.linalg.norm(translation), rel=1e-9)
    intrinsics = intrinsics_of_matrix(maps.left.matrix, 160, 120, where="here")
    points = np.random.default_rng(4).uniform([-8, -6, 50], [8, 6, 80], (30, 3))
    turned = points @ maps.left.rotation.T
    u = intrinsics.fx * turned[:, 0] / turned[:, 2] + intrinsics.cx
    v = intrinsics.fy * turned[:, 1] / turned[:, 2] + intrinsics.cy
    disparity = intrinsics.fx * maps.baseline / turned[:, 2]
    for shift, map_, matrix, coefficients, turn, move in (
        (0.0, maps.left, matrices[0], left, np.zeros(3), np.zeros(3)),
        (disparity, maps.right, matrices[1], right, Rotation.from_matrix(rotation).as_rotvec(), translation),
    ):
        seen = cv2.projectPoints(points, turn, move, matrix, np.array(coefficients))[0].reshape(-1, 2)
        place = [(u - shift - 0.5).astype(np.float32), (v - 0.5).astype(np.float32)]
        for plane, expected in zip((map_.x, map_.y), seen.T):
            found = cv2.remap(plane, *place, cv2.INTER_LINEAR).ravel()
            np.testing.assert_allclose(found, expected, atol=0.05)


def test_stereomis_with_the_calibration_of_one_camera_has_its_masks(tmp_path):
    stereomis(tmp_path / "raw")
    (tmp_path / "k.txt").write_text("60 0 31\n0 61 24\n0 0 1\n")
    found = describe(tmp_path / "raw", SourceOptions(calibration=tmp_path / "k.txt"))
    assert found.calibration is None and found.masks is not None and found.masks(0).shape == (HEIGHT, WIDTH)


def test_stereomis_as_it_is_distributed(tmp_path):
    stereomis(tmp_path / "P2_8")
    assert layout_of(tmp_path / "P2_8").name == "stereomis"
    found, notes = prepared(tmp_path / "P2_8", tmp_path / "out")
    assert (found.frames, found.unit, found.frame_rate) == (6, "mm", 25.0)
    assert found.camera.baseline == pytest.approx(4.0) and any("rectified: baseline 4 mm" in note for note in notes)
    clip = describe(tmp_path / "out")
    pair = next(clip.pictures([2]))
    assert pair.right is not None and pair.right.shape == (HEIGHT, WIDTH, 3)
    assert clip.masks is not None
    assert 0.6 < clip.masks(0).mean() < 0.97 and not clip.masks(0)[8, 12]  # pyright: ignore[reportOptionalMemberAccess]
    centres = [-pose.rotation.T @ pose.translation for pose in clip.poses or [] if pose]
    np.testing.assert_allclose(np.diff(centres, axis=0), [[1.0, 0, 0]] * 5, atol=1e-9)  # metres became millimetres


def test_a_turned_rig_turns_the_poses(tmp_path):
    """The rectified left camera looks along another axis; its centre stays where the trajectory says."""
    rotation = Rotation.from_euler("xyz", [0.0, 0.05, 0.02]).as_matrix()
    stereomis(tmp_path / "raw", calibration=ini(rotation=rotation, translation=(-4.0, 0.1, 0.2)))
    prepared(tmp_path / "raw", tmp_path / "out")
    poses = describe(tmp_path / "out").poses
    assert poses and poses[3] is not None
    assert np.abs(poses[3].rotation - np.eye(3)).max() > 0.01
    np.testing.assert_allclose(-poses[3].rotation.T @ poses[3].translation, [3.0, 0, 0], atol=1e-9)


@pytest.mark.parametrize("what", ["masks", "groundtruth.txt"])
def test_gaps_are_named_refused_left_out_or_filled(tmp_path, what):
    stereomis(tmp_path / "raw")
    if what == "masks":
        (tmp_path / "raw/masks/000002l.png").unlink()
    else:
        lines = (tmp_path / "raw" / what).read_text().splitlines()
        (tmp_path / "raw" / what).write_text("\n".join(lines[:2] + lines[3:]))
    word = "mask" if what == "masks" else "pose"
    with pytest.raises(InputError, match=f"1 of 6 frames have no {word}: 2; use --gaps"):
        prepared(tmp_path / "raw", tmp_path / "a")
    assert not (tmp_path / "a").exists()
    assert prepared(tmp_path / "raw", tmp_path / "b", PrepareSettings(gaps="drop"))[0].frames == 5
    for gaps in ("refuse", "drop", "fill"):
        with pytest.raises(InputError, match=f"1 of 1 frames have no {word}: 2; use --frames some of which have"):
            prepared(tmp_path / "raw", tmp_path / "d", PrepareSettings(frames="2", gaps=gaps))
    found, notes = prepared(tmp_path / "raw", tmp_path / "c", PrepareSettings(gaps="fill"))
    assert found.frames == 6 and any(f"no {word}: 2" in note for note in notes)
    if word == "pose":
        assert found.poses and found.poses.matrices[2][3] == pytest.approx(-2.0)


@pytest.mark.parametrize("binary", [False, True])
def test_colmap(tmp_path, binary):
    points, poses = colmap(tmp_path / "model", binary)
    assert layout_of(tmp_path / "model").name == "colmap"
    found, _ = prepared(tmp_path / "model", tmp_path / "out", PrepareSettings(points="sparse"))
    clip = describe(tmp_path / "out")
    assert found.unit == "arbitrary" and clip.intrinsics == (60.0, 61.0, 30.0, 25.0, 64, 48, ())
    assert clip.poses and clip.depth
    for pose, (rotation, translation) in zip(clip.poses, poses):
        assert pose is not None
        np.testing.assert_allclose(pose.rotation, rotation, atol=1e-12)
        np.testing.assert_allclose(pose.translation, translation, atol=1e-12)
    view = points @ poses[2][0].T + poses[2][1]
    depth = clip.depth(2)
    assert depth is not None and 20 < np.count_nonzero(depth) <= 40
    for x, y, z in view:
        column, row = int(60 * x / z + 30), int(61 * y / z + 25)
        if 0 <= column < 64 and 0 <= row < 48:
            assert 0 < depth[row, column] <= z + 1e-3


def test_depth_between_points_lies_on_their_planes(tmp_path):
    """The points of a slanted plane: 1 / z is linear in the picture, so the interpolation is exact."""
    from endotsr.clips.formats.camera import CameraPose, Intrinsics
    from endotsr.clips.sequences.points import depth_from_points

    rng = np.random.default_rng(0)
    x, y = rng.uniform(-4, 4, (2, 60))
    points = np.column_stack([x, y, 10 + 0.3 * x - 0.2 * y])
    intrinsics = Intrinsics(60.0, 50.0, 30.0, 26.0, 64, 48)
    depth = depth_from_points(points, CameraPose(np.eye(3), np.zeros(3)), intrinsics, "interpolated")
    row, column = np.nonzero(depth)
    assert len(row) > 1000
    a, b = (column + 0.5 - 30) / 60, (row + 0.5 - 26) / 50
    np.testing.assert_allclose(depth[row, column], 10 / (1 - 0.3 * a + 0.2 * b), rtol=1e-5)


def test_tum(tmp_path):
    tum(tmp_path / "desk")
    found, _ = prepared(tmp_path / "desk", tmp_path / "out", camera=CAMERA)
    sequence = read_sequence(tmp_path / "out", WHOLE, 0.2)
    assert found.frame_rate == pytest.approx(25.0, rel=1e-4) and sequence.unit == "mm"
    for i in range(5):
        np.testing.assert_allclose(sequence.depth[i, 1:], (300 + i) / 5, atol=0.02)  # 5000 steps a metre
        np.testing.assert_allclose(camera_centre(sequence.cameras[i]), [8.0 * i, 0, 0], atol=1e-6)


def test_a_distorted_picture_is_straightened(tmp_path):
    files(tmp_path, "clip", [scene_picture(0)])
    found, notes = prepared(tmp_path / "clip", tmp_path / "out", camera=CAMERA, distortion=(-0.2, 0.0, 0.0, 0.0))
    assert found.camera.distortion == [] and any("undistorted" in note for note in notes)
    matrix = np.array([[60.0, 0, 29.5], [0, 61.0, 24.5], [0, 0, 1]])
    new = np.array(
        [[found.camera.fx, 0, found.camera.cx - 0.5], [0, found.camera.fy, found.camera.cy - 0.5], [0, 0, 1]]
    )
    expected = cv2.undistort(scene_picture(0), matrix, np.array([-0.2, 0, 0, 0]), None, new)
    apart = np.abs(expected.astype(int) - read_png(tmp_path / "out/images/000000.png").astype(int))
    assert apart.mean() < 1.0


WRONG = {
    "no intrinsics": (lambda p: None, {}, "intrinsics are unknown; use --camera"),
    "no mask of these numbers": (lambda p: masks(p, "m90", "m91"), {"camera": CAMERA}, "no file has the number"),
    "trajectory": (lambda p: (p / "t.txt").write_text("0 0 0 0 0 1"), {"camera": CAMERA}, "line 1: use 8"),
    "quaternion": (lambda p: (p / "t.txt").write_text("0 0 0 0 0 0 0 2"), {"camera": CAMERA}, "has length 2"),
    "trajectory empty": (lambda p: (p / "t.txt").write_text("# x\n"), {"camera": CAMERA}, "holds no pose"),
    "no rate": (lambda p: (p / "t.txt").write_text("0.5 0 0 0 0 0 0 1"), {"camera": CAMERA}, "known frame rate"),
}  # fmt: skip


def masks(root, *names):
    (root / "m").mkdir()
    for name in names:
        write_png(root / "m" / f"{name}.png", np.zeros((HEIGHT, WIDTH), np.uint8))


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_source_leaves_nothing(tmp_path, case):
    damage, options, message = WRONG[case]
    files(tmp_path, "clip", [scene_picture(i) for i in range(3)])
    damage(tmp_path)
    extra = {"trajectory": tmp_path / "t.txt"} if (tmp_path / "t.txt").exists() else {}
    extra |= {"masks": tmp_path / "m"} if (tmp_path / "m").exists() else {}
    with pytest.raises(InputError, match=message):
        prepared(tmp_path / "clip", tmp_path / "out", **options, **extra)
    assert not (tmp_path / "out").exists() and not [p for p in tmp_path.iterdir() if p.name.startswith(".")]


STEREOMIS = {
    "two videos": (lambda p: (p / "b.mp4").write_bytes(b"x"), "2 videos"),
    "damaged video": (lambda p: (p / "IFBS_part0001.mp4").write_bytes(b"x" * 99), "not a video"),
    "no section": (lambda p: (p / "StereoCalibration.ini").write_text("[StereoLeft]\n"), r"\[StereoRight\] is miss"),
    "no ini": (lambda p: (p / "StereoCalibration.ini").write_text("hello"), "not a calibration in ini form"),
    "key": (lambda p: swap(p, "fc_x = 60\n", ""), r"\[StereoLeft\] fc_x is missing"),
    "coefficient left out": (lambda p: swap(p, "kc_5 = 0.0\n", ""), r"kc_5 is missing"),
    "six coefficients": (lambda p: swap(p, "kc_5 = 0.0\nkc_6 = 0.0\nkc_7 = 0.0", "kc_5 = 0.1"),
                         r"kc_0 .. kc_7: 6 distortion coefficients; use none, 4, 5 or 8"),
    "text": (lambda p: swap(p, "fc_x = 60\n", "fc_x = a\n"), r"fc_x = 'a' is not allowed"),
    "size": (lambda p: swap(p, "res_y = 48", "res_y = 100"), "of 64x100 pixels, the pictures have 64x48"),
    "swapped": (lambda p: swap(p, "T_0 = -4.0", "T_0 = 4.0"), "right camera is on the left"),
    "above": (lambda p: swap(p, "T_1 = 0.0", "T_1 = 9.0"), "4 apart horizontally and 9 vertically"),
    "one place": (lambda p: swap(p, "T_0 = -4.0", "T_0 = 0.0"), "are in one place"),
    "no rotation": (lambda p: swap(p, "R_0 = 1.0", "R_0 = 3.0"), "not perpendicular unit vectors"),
}  # fmt: skip


def swap(folder, old, new):
    file = folder / "StereoCalibration.ini"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))


@pytest.mark.parametrize("case", STEREOMIS)
def test_a_wrong_stereomis_folder_leaves_nothing(tmp_path, case):
    damage, message = STEREOMIS[case]
    stereomis(tmp_path / "raw", frames=2)
    damage(tmp_path / "raw")
    with pytest.raises(InputError, match=message):
        prepared(tmp_path / "raw", tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("cut", [4, 30, 70, 200, 1000])
def test_a_cut_off_colmap_file_is_refused(tmp_path, cut):
    colmap(tmp_path / "model", True)
    for name in ("cameras", "images", "points3D"):
        file = tmp_path / "model/sparse/0" / f"{name}.bin"
        whole = file.read_bytes()
        if cut < len(whole):
            file.write_bytes(whole[:cut])
            with pytest.raises(InputError, match=f"{name}.bin"):
                describe(tmp_path / "model", SourceOptions())
            file.write_bytes(whole)


def test_the_step_of_the_depth_is_a_round_number_and_large_enough():
    for largest in (0.001, 0.9, 1.0, 60.0, 110.0, 5000.0):
        step = step_of_depth(largest)
        assert step * 65535 >= 8 * largest * 0.999 and f"{step:.0e}"[0] in "125"
        assert step <= largest / 500


def test_the_command(tmp_path, capsys):
    out = tmp_path / "my clip"
    stereomis(tmp_path / "raw")
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(out), "--frames", "0:4", "--scale", "0.5"]) == 0
    said = capsys.readouterr().out
    assert "layout stereomis, 6 frames" in said and "4 frames of 32x24" in said
    assert f"next: endotsr depth '{out}'" in said
    assert read_sequence_file(out).frames == 4
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["prepare", str(tmp_path / "none"), "--out", str(tmp_path / "x")]) == 2
    assert main(["prepare", str(tmp_path), "--out", str(tmp_path / "x"), "--camera", "1", "2"]) == 2
    assert "--camera: 2 numbers; use 4" in capsys.readouterr().err


def test_a_clip_with_poses_is_told_of_no_depth_that_they_exclude(tmp_path, capsys):
    """`depth --kind relative` and `--flat` refuse a camera that moves, and `poses` those that are there."""
    files(tmp_path / "clip", "pictures", [scene_picture(i) for i in range(4)])
    (tmp_path / "poses.txt").write_text("".join(f"{i} {i / 100} 0 0 0 0 0 1\n" for i in range(4)))
    words = ["--trajectory", str(tmp_path / "poses.txt"), "--source-rate", "1", "--camera", *map(str, CAMERA)]
    assert main(["prepare", str(tmp_path / "clip/pictures"), "--out", str(tmp_path / "o"), *words]) == 0
    said = capsys.readouterr().out
    assert "--kind relative" not in said and "--flat" not in said
    assert f"next: endotsr depth {tmp_path / 'o'} --given FILES --kind depth" in said
    files(tmp_path, "depth", [np.full((HEIGHT, WIDTH), 60, np.uint16) for _ in range(4)])
    assert main(["depth", str(tmp_path / "o"), "--given", str(tmp_path / "depth"), "--kind", "depth"]) == 0


def test_a_pair_without_a_baseline_is_told_which_number_is_missing(tmp_path, capsys):
    for side in ("left", "right"):
        files(tmp_path / "clip", side, [scene_picture(i) for i in range(3)])
    words = ["--camera", *map(str, CAMERA)]
    assert main(["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), *words]) == 0
    assert "next: set the baseline of the two cameras, [camera] baseline" in capsys.readouterr().out
    with pytest.raises(InputError, match="once \\[camera\\] baseline, the distance between the two cameras"):
        read_sequence(tmp_path / "o", WHOLE, 0.2)
    assert main(["depth", str(tmp_path / "o")]) == 2 and "use the distance between the two" in capsys.readouterr().err


def test_a_pipe_gets_no_carriage_returns(tmp_path, capsys):
    written(tmp_path / "a", right=True)
    main(["depth", str(tmp_path / "a"), "--given", str(tmp_path / "a/depth"), "--kind", "depth", "--replace"])
    said = capsys.readouterr().out
    assert "depth of 5 frames" in said and "\r" not in said and "\n\n" not in said


def test_the_working_folder_as_a_source_has_its_name(tmp_path, monkeypatch):
    written(tmp_path / "my clip")
    monkeypatch.chdir(tmp_path / "my clip")
    assert main(["prepare", ".", "--out", str(tmp_path / "o")]) == 0
    assert read_sequence_file(tmp_path / "o").source == "my clip (common)"
    monkeypatch.chdir("images")
    assert carrying_command(Path()).endswith("--out images_masks --replace")


@pytest.mark.parametrize(("make", "option"), [(tum, "trajectory"), (tum, "depth"), (stereomis, "trajectory")])
def test_an_arbitrary_unit_beside_known_lengths_is_refused(tmp_path, make, option, capsys):
    make(tmp_path / "raw")
    words = [f"--{option}-unit", "arbitrary", *(["--camera", *map(str, CAMERA)] if make is tum else [])]
    if option == "depth":
        (tmp_path / "raw/depth").rename(tmp_path / "given")
        words += ["--depth", str(tmp_path / "given")]
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "out"), *words]) == 2
    said = capsys.readouterr().err
    assert f"--{option}-unit arbitrary: the layout" in said and "use one of um, mm, cm, m" in said
