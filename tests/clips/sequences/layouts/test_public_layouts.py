"""Public layouts, read from folders made as their documentation says: cameras, depth, poses and masks are true."""

import gzip
import json
import tarfile
import tracemalloc

import numpy as np
import public_layouts as made
import pytest
from made_videos import files

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.layouts import c3vd as c3vd_layout
from endotsr.clips.sequences.layouts import describe, layout_of, scared
from endotsr.clips.sequences.layouts.scared import frame_texts
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.errors import InputError

LENS = (100.0, 101.0, 64.0, 48.0)  # of the pictures: half a pixel more than K of OpenCV


def prepared(folder, *words):
    """The raw folder as a prepared recording."""
    assert main(["prepare", str(folder / "raw"), "--out", str(folder / "o"), *words]) == 0
    return describe(folder / "o")


def same_poses(found, scale=1.0):
    for pose, true in zip(found, made.poses(), strict=True):
        np.testing.assert_allclose(pose.rotation, true[:3, :3], atol=1e-6)
        np.testing.assert_allclose(pose.translation * scale, true[:3, 3], atol=1e-6)


@pytest.mark.parametrize("names", [("image01", "image02", "depth01"), ("color", "depth")])
@pytest.mark.parametrize("columns", [3, 4])
def test_hamlyn(names, columns, tmp_path, capsys):
    made.hamlyn(tmp_path / "raw", names, columns)
    assert layout_of(tmp_path / "raw").name == "hamlyn"
    found = prepared(tmp_path, *(("--baseline", "5") if len(names) == 3 else ()))
    assert found.intrinsics[:4] == LENS and found.count == made.FRAMES and found.poses is None
    assert (found.baseline == 5.0) == (len(names) == 3)
    np.testing.assert_allclose(found.depth(2), np.rint(made.depth(2)), atol=0.01)
    assert "half a pixel was added" in capsys.readouterr().out


def test_servct(tmp_path, capsys):
    made.servct(tmp_path / "raw")
    found = prepared(tmp_path)
    assert found.intrinsics[:4] == LENS and found.baseline == pytest.approx(made.BASELINE)
    np.testing.assert_allclose(found.depth(3), made.depth(3), atol=0.01)
    assert "not for training one scene" in capsys.readouterr().out


def test_servct_of_two_cameras_is_refused(tmp_path, capsys):
    other = made.K.copy()
    other[0, 0] = 110
    made.servct(tmp_path / "raw", (made.K, made.K, other, made.K))
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "o")]) == 2
    assert "003.json: another camera than 001.json" in capsys.readouterr().err


@pytest.mark.parametrize("archive", [True, False])
def test_scared(archive, tmp_path):
    made.scared(tmp_path / "raw", archive)
    found = prepared(tmp_path)
    assert (found.baseline, found.rate) == (pytest.approx(made.BASELINE), 25.0)
    np.testing.assert_allclose(found.intrinsics[0], 100.5, atol=0.6)  # rectified: one focal length
    same_poses(found.poses)
    pair = next(found.pictures([1]))
    assert pair.right is not None and pair.left.shape == (made.HEIGHT, made.WIDTH, 3)


@pytest.mark.parametrize("archive", [True, False])
def test_numbers_without_leading_zeros_are_in_order(archive, tmp_path):
    texts = {f"frame_data{i}.json": str(i) for i in range(12)}
    made.frame_data(tmp_path, {name: texts[name] for name in sorted(texts)}, archive)
    found = [content if isinstance(content, str) else content.decode() for _, content in frame_texts(tmp_path)]
    assert found == [str(i) for i in range(12)]


@pytest.mark.parametrize("kind", [tarfile.REGTYPE, tarfile.XHDTYPE], ids=["a member", "a header"])
def test_an_archive_that_unpacks_to_far_more_than_its_size_is_refused(kind, tmp_path, monkeypatch):
    """Zeros compress to a thousandth: refused before they are unpacked, also where they are the header of a member."""
    monkeypatch.setattr(scared, "LARGEST_ARCHIVE", 1 << 20, raising=False)
    (tmp_path / "data").mkdir()
    entry = tarfile.TarInfo("x.json")
    entry.size, entry.type = 1 << 26, kind
    with gzip.open(tmp_path / "data/frame_data.tar.gz", "wb", compresslevel=1) as file:
        file.write(entry.tobuf())
        file.write(bytes(1 << 26))
    tracemalloc.start()
    with pytest.raises(InputError, match=r"frame_data.tar.gz: unpacks to more than 1 MiB"):
        frame_texts(tmp_path)
    assert tracemalloc.get_traced_memory()[1] < 1 << 24
    tracemalloc.stop()


def test_files_that_macos_writes_beside_others_are_passed_over(tmp_path):
    """`._NAME` holds attributes of NAME, in folders copied from macOS and in archives made there."""
    made.scared(tmp_path / "scared", archive=False)
    (tmp_path / "scared/data/frame_data/._frame_data000000.json").write_bytes(b"\0\5\x16\7\xff")
    made.c3vd(tmp_path / "c3vd")
    (tmp_path / "c3vd/._0_color.png").write_bytes(b"\0\5\x16\7\xff")
    assert describe(tmp_path / "scared").count == made.FRAMES and describe(tmp_path / "c3vd").count == 2
    files(tmp_path, "pictures", map(made.picture, range(3)))
    (tmp_path / "pictures/times.txt").write_text("0.0\n0.1\n0.3\n")
    (tmp_path / "pictures/._times.txt").write_bytes(b"\0\5\x16\7\xff")
    np.testing.assert_allclose(describe(tmp_path / "pictures").times, [0.0, 0.1, 0.3])


def test_depth_of_c3vd_by_either_ending(tmp_path):
    made.c3vd(tmp_path / "raw")
    for file in sorted((tmp_path / "raw").glob("*_depth.tiff")):
        file.rename(file.with_suffix(".tif"))
    found = describe(tmp_path / "raw")
    assert found.depth is not None and (found.depth(1) > 0).any()


def test_scared_without_kinematics_rests_and_a_broken_archive_is_refused(tmp_path, capsys):
    made.scared(tmp_path / "raw")
    (tmp_path / "raw/data/frame_data.tar.gz").write_bytes(b"\x1f\x8b no archive")
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "o")]) == 2
    assert "frame_data.tar.gz: cannot be read" in capsys.readouterr().err
    (tmp_path / "raw/data/frame_data.tar.gz").unlink()
    assert prepared(tmp_path).poses is None


def test_c3vd(tmp_path):
    made.c3vd(tmp_path / "raw")
    found = describe(tmp_path / "raw", SourceOptions())
    assert found.layout == "c3vd" and found.intrinsics[:2] == (769.243600037458,) * 2
    for pose, true in zip(found.poses, made.poses()):
        np.testing.assert_allclose(pose.rotation, true[:3, :3], atol=1e-7)
        np.testing.assert_allclose(pose.translation, true[:3, 3], atol=1e-6)
    plane = found.depth(1)
    row, column = 543, 679  # near the axis the two cameras agree
    assert plane[row, column] == pytest.approx(made.depth(1, 1350, 1080)[row, column], abs=0.01)
    assert not (plane > 99.9).any() and (plane == 0).any()  # beyond the range is no depth


def test_the_pinhole_of_c3vd_undoes_the_published_model():
    """A ray projected by Scaramuzza's polynomial, solved by bisection, lies where the map looks."""
    maps = c3vd_layout.pinhole_maps()
    a = c3vd_layout.POLYNOMIAL
    for row, column in ((100, 200), (900, 1200), (540, 60)):
        x = (column - maps.matrix[0, 2]) / maps.matrix[0, 0]
        y = (row - maps.matrix[1, 2]) / maps.matrix[1, 1]
        low, high = 0.0, 900.0
        for _ in range(60):  # radius / z(radius) = tan of the angle
            radius = (low + high) / 2
            high, low = (radius, low) if radius > np.hypot(x, y) * np.polyval(a[::-1], radius) else (high, radius)
        direction = np.array([x, y]) / np.hypot(x, y) * radius
        expected = np.array(c3vd_layout.STRETCH) @ direction + c3vd_layout.CENTRE
        np.testing.assert_allclose([maps.x[row, column], maps.y[row, column]], expected, atol=0.02)


def test_nerfstudio(tmp_path):
    made.nerfstudio(tmp_path / "raw")
    found = prepared(tmp_path)
    assert found.intrinsics[:4] == LENS and found.unit == "arbitrary"
    same_poses(found.poses, 1000.0)
    np.testing.assert_allclose(found.depth(2) * 1000, np.rint(made.depth(2)), atol=0.02)
    assert found.masks(0)[:, 41:].all() and not found.masks(0)[:, :39].any()  # black is left out
    first = next(found.pictures([0])).left
    assert (first == read_png(tmp_path / "raw/images/frame_00000.png")).all()  # sorted by name, not as listed


def test_nerfstudio_points_stand_for_depth(tmp_path, capsys):
    made.nerfstudio(tmp_path / "raw", with_depth=False, ply_file_path="sparse_pc.ply")
    x, y = np.meshgrid(np.linspace(-0.04, 0.04, 9), np.linspace(-0.03, 0.03, 9))
    rows = "\n".join(f"{a} {b} 0.06 9 9 9" for a, b in zip(x.ravel(), y.ravel()))
    head = (
        "ply\nformat ascii 1.0\nelement vertex 81\nproperty float x\nproperty float y\nproperty float z\n"
        + "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
        + "end_header\n"
    )
    (tmp_path / "raw/sparse_pc.ply").write_text(head + rows)
    plane = prepared(tmp_path).depth(0)
    np.testing.assert_allclose(plane[plane > 0], 0.06, atol=1e-4)
    assert "does not state their visibility" in capsys.readouterr().out


@pytest.mark.parametrize(("changes", "said"), [
    ({"frames": []}, "at least one"), ({"fl_x": "a"}, "fl_x"),
    ({"frames": [{"file_path": "../secret.png", "transform_matrix": []}]}, "begins with a dot"),
])  # fmt: skip
def test_what_nerfstudio_cannot_mean_is_refused(changes, said, tmp_path, capsys):
    made.nerfstudio(tmp_path / "raw", **changes)
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "o")]) == 2
    assert said in capsys.readouterr().err


SIDES = ["{:03d}_left|{:03d}_right", "left_{:03d}|right_{:03d}", "{:06d}l|{:06d}r", "{:02d}-L|{:02d}-R"]


@pytest.mark.parametrize("names", SIDES)
def test_sides_by_the_names_of_files(names, tmp_path):
    left, right = names.split("|")
    (tmp_path / "raw").mkdir()
    for i in range(11):
        write_png(tmp_path / "raw" / f"{left.format(i)}.png", np.full((20, 30, 3), (i, 0, 0), np.uint8))
        write_png(tmp_path / "raw" / f"{right.format(i)}.png", np.full((20, 30, 3), (i, 200, 0), np.uint8))
    found = describe(tmp_path / "raw", SourceOptions(baseline=4.0))
    assert found.count == 11
    for i, pair in enumerate(found.pictures(list(range(11)))):
        assert pair.left[0, 0].tolist() == [i, 0, 0] and pair.right[0, 0].tolist() == [i, 200, 0]


def test_a_folder_with_both_videos_of_a_pair_takes_no_other_view(tmp_path):
    (tmp_path / "raw").mkdir()
    for name in ("raw/left", "raw/right", "other"):
        made.write(tmp_path / f"{name}.mkv", [made.picture(i) for i in range(3)])
    with pytest.raises(InputError, match="raw: has a right video, and --right names another; use one of them"):
        describe(tmp_path / "raw", SourceOptions(right=tmp_path / "other.mkv", baseline=4.0))
    with pytest.raises(InputError, match="two videos of a pair and --stereo side_by_side; use one of them"):
        describe(tmp_path / "raw", SourceOptions(stereo="side_by_side", baseline=4.0))


def test_a_side_without_its_other_is_refused(tmp_path):
    (tmp_path / "raw").mkdir()
    for name in ("0_left", "1_left", "0_right"):
        write_png(tmp_path / "raw" / f"{name}.png", np.zeros((20, 30, 3), np.uint8))
    with pytest.raises(InputError):
        describe(tmp_path / "raw", SourceOptions(baseline=4.0))


def test_out_to_other_programs_and_back(tmp_path, capsys):
    made.nerfstudio(tmp_path / "raw")
    found = prepared(tmp_path, "--also", "nerfstudio", "colmap")
    assert "transforms.json: lengths in" in capsys.readouterr().out
    (tmp_path / "o/sequence.toml").unlink()
    for layout in ("nerfstudio", "colmap"):
        back = describe(tmp_path / "o", SourceOptions(layout=layout))
        np.testing.assert_allclose(back.intrinsics[:6], found.intrinsics[:6])
        scale = found.depth(1).max() / (back.depth(1).max() if layout == "nerfstudio" else found.depth(1).max())
        for one, other in zip(back.poses, found.poses, strict=True):
            np.testing.assert_allclose(one.rotation, other.rotation, atol=1e-9)
            np.testing.assert_allclose(one.translation * scale, other.translation, atol=1e-6)
        if layout == "nerfstudio":
            np.testing.assert_allclose(back.depth(1) * scale, found.depth(1), rtol=1e-6)
            assert (back.masks(2) == found.masks(2)).all()
        else:
            points = back.points(0)
            depth = (points @ back.poses[0].rotation.T + back.poses[0].translation)[:, 2]
            assert (
                500 < len(points) and found.depth(0).min() <= depth.min() and depth.max() <= found.depth(0).max() + 1e-6
            )


def test_points_of_nerfstudio_follow_applied_scale(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    found = []
    for k, applied in enumerate((1.0, 0.25)):
        folder = tmp_path / str(k)
        made.nerfstudio(folder, False, ply_file_path="cloud.ply", applied_scale=applied)
        (folder / "cloud.ply").write_text(head + "1 2 3\n")
        found.append(describe(folder).points(0))
    np.testing.assert_allclose(found[1], 0.25 * found[0], rtol=1e-6)


@pytest.mark.parametrize("excluded", ["white", "black"])
def test_stated_masks_of_points_have_the_stated_polarity(tmp_path, excluded):
    files(tmp_path, "raw/images", [np.full((48, 64, 3), (150, 60, 60), np.uint8)] * 3)
    poses, K = np.tile(np.eye(4), (3, 1, 1)), np.array([[60.0, 0, 32], [0, 60, 24], [0, 0, 1]])
    points, visible = np.array([[0.0, 0, 5], [1, 0, 6], [0, 1, 7], [1, 1, 5]]), np.ones((4, 3), bool)
    np.savez(
        tmp_path / "raw/cameras_points.npz", w2c=poses, K=K, points=points, visible=visible, frame_ids=np.arange(3)
    )
    tool = np.zeros((48, 64), np.uint8)
    tool[:, :16] = 255
    for file in (tmp_path / "raw/mask.png", tmp_path / "other.png"):
        write_png(file, tool)
    assert describe(tmp_path / "raw").masks(0).mean() == 0.25
    stated = SourceOptions(masks=tmp_path / "other.png", excluded_value=excluded)
    clip = describe(tmp_path / "raw", stated)
    assert clip.masks(0).mean() == (0.75 if excluded == "white" else 0.25)
    assert "mask.png: not read, because --masks is stated" in clip.notes


def test_the_times_of_transforms_give_a_rate(tmp_path):
    made.nerfstudio(tmp_path / "raw")
    file = tmp_path / "raw/transforms.json"
    stated = json.loads(file.read_text())
    for i, entry in enumerate(stated["frames"]):
        entry["time"] = 2.0 + i / 25
    file.write_text(json.dumps(stated))
    count = len(stated["frames"])
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "o"), "--rate", "12.5"]) == 0
    found = describe(tmp_path / "o")
    assert found.count == (count + 1) // 2 and found.rate == pytest.approx(12.5)
