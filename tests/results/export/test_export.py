"""Scenes as files: what other programs read, what comes back, and what is refused."""

import io
import json

import msgspec
import numpy as np
import pytest
from made_up_model import CAMERA, moving_scene

from endotsr.errors import InputError
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.render import check_scene
from endotsr.results.export.files import Content, export
from endotsr.results.export.model import load_slim_model
from endotsr.results.export.npz import ARRAYS, read_arrays
from endotsr.results.export.ply import read_gaussians
from endotsr.results.export.scene import MovingScene, open_scene
from endotsr.results.export.times import Times

plyfile = pytest.importorskip("plyfile", reason="plyfile, an outside reader of ply files, is not installed")


def psnr(a, b):
    return -10 * np.log10(np.mean((a - b) ** 2))


def test_an_outside_reader_finds_the_standard_properties(tmp_path):
    scene = moving_scene()
    said = export(scene, tmp_path / "a.ply", Times(times=(0.4,)))
    data = plyfile.PlyData.read(tmp_path / "a.ply")
    vertex, moment = data["vertex"].data, scene.at(0.4)
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{k}" for k in range(3)), *(f"f_rest_{k}" for k in range(45))]
    names += ["opacity", *(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
    assert list(vertex.dtype.names) == names and not data.text and data.byte_order == "<"
    assert {vertex.dtype[name] for name in names} == {np.dtype("<f4")} and "80 gaussians at time 0.4" in said
    assert np.array_equal([vertex["x"], vertex["y"], vertex["z"]], moment.position)
    assert np.array_equal(vertex["f_dc_1"], moment.harmonics[0, 1] + moment.residual[1])
    assert np.array_equal(vertex["f_rest_17"], moment.harmonics[3, 1]), "all of red, then green, then blue"
    rotation = np.stack([vertex[f"rot_{k}"] for k in range(4)])
    assert np.allclose(np.linalg.norm(rotation, axis=0), 1)


def test_a_ply_file_shows_the_scene_at_its_time(tmp_path):
    scene = moving_scene()
    export(scene, tmp_path / "a.ply", Times(times=(0.4,)))
    again = open_scene(tmp_path / "a.ply")
    a, b = scene.render(0.4, CAMERA).colour, again.render(0.9, CAMERA).colour
    assert psnr(a, b) > 80 and psnr(a, scene.render(0.9, CAMERA).colour) < 60
    facing = again.render(0.0, CAMERA._replace(width=32, height=32))
    assert facing.opacity.mean() > 0.01


def test_points_are_the_opaque_centres_with_their_colours(tmp_path):
    scene = moving_scene()
    export(scene, tmp_path / "a.ply", Times(times=(0.4,)), Content("points", 0.6))
    vertex, moment = plyfile.PlyData.read(tmp_path / "a.ply")["vertex"].data, scene.at(0.4)
    chosen = 1 / (1 + np.exp(-moment.opacity_logit)) >= 0.6
    assert list(vertex.dtype.names) == ["x", "y", "z", "red", "green", "blue"]
    assert np.array_equal(vertex["y"], moment.position[1, chosen])
    shade = np.clip(0.5 + Y00 * (moment.harmonics[0, 2] + moment.residual[2]), 0, 1)[chosen]
    assert np.abs(vertex["blue"] / 255 - shade).max() < 0.003


def test_a_folder_holds_one_file_for_every_time(tmp_path):
    scene = moving_scene()
    said = export(scene, tmp_path / "a", Times(count=3))
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == ["00000.ply", "00001.ply", "00002.ply"]
    assert "3 files of gaussians" in said
    middle = read_gaussians(tmp_path / "a" / "00001.ply")
    assert np.array_equal(middle.position, scene.at(0.5).position)


@pytest.mark.parametrize("exposure", [False, True])
def test_a_slim_model_renders_the_same_picture_to_half_precision(exposure, tmp_path):
    scene = moving_scene(exposure=exposure)
    export(scene, tmp_path / "a.npz")
    again = open_scene(tmp_path / "a.npz")
    assert again.record == scene.record and again.model.config == scene.model.config and again.model.iteration == 7
    for time in (0.0, 0.3, 1.0):
        assert psnr(scene.render(time, CAMERA).colour, again.render(time, CAMERA).colour) > 50
    assert np.array_equal(again.model.gaussians.position, scene.model.gaussians.position)
    export(scene, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_numbers_beyond_half_precision_stay_finite(tmp_path):
    scene = moving_scene()
    scene.model.gaussians.opacity_logit[0] = 1e6
    export(scene, tmp_path / "a.npz")
    check_scene(open_scene(tmp_path / "a.npz").at(0.0))


@pytest.mark.parametrize(
    ("name", "times", "content", "said"),
    [
        ("a.npz", Times(count=2), Content(), "a slim model stores all times"),
        ("a.npz", Times(), Content("points"), "a slim model stores all times"),
        ("a.ply", Times(count=2), Content(), "a .ply file stores one time, not 2"),
        ("a.ply", Times(times=(1.5,)), Content(), "export: --times 1.5 is not allowed"),
        ("a.ply", Times(), Content(least_opacity=2), "--opacity 2 is not allowed"),
        ("a.mp4", Times(), Content(), "a folder of ply files, but this is the name of a .mp4 file"),
        ("no/a.ply", Times(), Content(), "cannot be written"),
    ],
)
def test_what_cannot_be_exported_is_refused(name, times, content, said, tmp_path):
    with pytest.raises(InputError) as refused:
        export(moving_scene(), tmp_path / name, times, content)
    assert said in str(refused.value) and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a", "run.2", "scale_0.5", "2026.11.24"])
def test_a_name_without_an_ending_is_a_folder(name, tmp_path):
    export(moving_scene(), tmp_path / name, Times(count=1))
    assert [file.name for file in (tmp_path / name).iterdir()] == ["00000.ply"]


def damaged(tmp_path, change):
    """A slim model with one entry changed."""
    export(moving_scene(), tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        entries = {name: file[name] for name in file.files}
    header = json.loads(entries["header"].tobytes())
    change(entries, header)
    if "header" in entries:
        entries["header"] = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(tmp_path / "b.npz", **entries)
    return tmp_path / "b.npz"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda e, h: e.pop("header"), "not a slim model, or damaged"),
        (lambda e, h: h.update(version=9), "not a slim model of version 1"),
        (lambda e, h: h.pop("config"), "header: config is missing"),
        (lambda e, h: h["config"]["model"].update(bases="x"), "model.bases = 'x' is not allowed"),
        (lambda e, h: h["sequence"].pop("cameras"), "sequence.cameras is missing"),
        (lambda e, h: h["sequence"].update(train_index=[9]), "train_index: use frames from 0 to"),
        (lambda e, h: e.pop("gaussians.quaternion"), "gaussians.quaternion is missing"),
        (lambda e, h: e.update({"gaussians.quaternion": e["gaussians.quaternion"][:3]}), "the shape (3, 80)"),
        (lambda e, h: e.update({"gaussians.fdm_width": e["gaussians.fdm_width"][:, :2]}), "use one shape"),
        (lambda e, h: e.pop("gaussians.fdm_centre"), "use one shape"),
        (lambda e, h: e.update({"gaussians.harmonics": e["gaussians.harmonics"][:5]}), "harmonics has the shape (5,"),
        (lambda e, h: e.update({"gaussians.log_scale": e["gaussians.log_scale"] * np.nan}), "not finite"),
        (lambda e, h: e.update({"gaussians.log_scale": e["gaussians.log_scale"].astype(int)}), "has type int64"),
        (lambda e, h: e.update(other=np.zeros(2)), "other is not an entry of a slim model"),
        (lambda e, h: h.update(frame_times=[0.0]), "two arrays for 1 frames expected"),
        (lambda e, h: h.update(frame_times=3), "header: frame_times: holds int; use a list"),
        (lambda e, h: h.update(frame_times=["0"]), "header: frame_times: '0' is not allowed"),
        (lambda e, h: h["config"]["model"].update(harmonics_degree=2), "model.harmonics_degree = 2, but its arrays"),
        (lambda e, h: h["config"]["model"].update(frequencies=9), "model.frequencies = 9, but its arrays have 8"),
    ],
)  # fmt: skip
def test_a_damaged_slim_model_is_refused(change, said, tmp_path):
    with pytest.raises(InputError) as refused:
        load_slim_model(damaged(tmp_path, change))
    assert said in str(refused.value) and "b.npz" in str(refused.value)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"ply"])
def test_files_that_are_no_scene_are_refused(content, tmp_path):
    for name in ("a.npz", "a.ply", "a.txt"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name.replace(".", r"\.")):
            _ = open_scene(tmp_path / name)


def test_a_ply_file_that_is_cut_short_or_odd_is_refused(tmp_path):
    export(moving_scene(), tmp_path / "a.ply")
    content = (tmp_path / "a.ply").read_bytes()
    for changed, said in (
        (content[:-1], "80 vertices of 248 bytes expected"),
        (content.replace(b"vertex 80", b"vertex 99999999999999999999"), "bytes expected"),
        (content.replace(b"vertex 80", b"vertex -1"), "with a count"),
        (content.replace(b"float opacity", b"float opacitx"), "property opacity is missing"),
        (content.replace(b"float rot_1", b"float rot_0"), "two with the same name"),
        (content.replace(b"property float f_rest_44\n", b""), "44 f_rest columns"),
        (content.replace(b"binary_little_endian", b"ascii"), "80 lines of 62 numbers expected"),
        (content.replace(b"binary_little_endian", b"binary"), "not a PLY file in one of the forms ascii"),
        (content.replace(b"float scale_2", b"float scale_x"), "flat Gaussians"),
        (content.replace(b"float nx", b"float trbf_centre"), "trbf_centre: the Gaussians of this file move"),
    ):
        (tmp_path / "b.ply").write_bytes(changed)
        with pytest.raises(InputError) as refused:
            read_gaussians(tmp_path / "b.ply")
        assert said in str(refused.value) and "b.ply" in str(refused.value)


def test_the_filter_of_mip_splatting_widens_the_gaussians_and_keeps_their_integral(tmp_path):
    names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split()
    found = []
    for extra in ([], ["filter_3D"]):
        vertices = np.ones(1, [(name, "f4") for name in names + extra])
        if extra:
            vertices["filter_3D"] = 2.0
        out = io.BytesIO()
        plyfile.PlyData([plyfile.PlyElement.describe(vertices, "vertex")]).write(out)
        (tmp_path / "a.ply").write_bytes(out.getvalue())
        read = read_gaussians(tmp_path / "a.ply")
        found.append((np.exp(read.log_scale[:, 0].astype(float)), 1 / (1 + np.exp(-float(read.opacity_logit[0])))))
    (narrow, opacity), (wide, less) = found
    np.testing.assert_allclose(wide**2, narrow**2 + 4, rtol=1e-5)
    np.testing.assert_allclose(less * wide.prod(), opacity * narrow.prod(), rtol=1e-5)


@pytest.mark.parametrize("logit", [40.0, 800.0, -800.0])
def test_the_filter_keeps_gaussians_whose_opacity_rounds_to_a_whole_number(logit, tmp_path):
    """An opacity of 1 in float64 became an infinite logit, and the Gaussian was left out."""
    names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 filter_3D".split()
    vertices = np.ones(2, [(name, "f4") for name in names])
    vertices["opacity"], vertices["filter_3D"] = logit, [0.0, 1e-3]
    out = io.BytesIO()
    plyfile.PlyData([plyfile.PlyElement.describe(vertices, "vertex")]).write(out)
    (tmp_path / "a.ply").write_bytes(out.getvalue())
    read = read_gaussians(tmp_path / "a.ply")
    assert read.count == 2 and read.opacity_logit[0] == logit and read.opacity_logit[1] < logit + 1e-3


def test_the_comments_of_a_ply_file_are_single_lines_of_plain_numbers(tmp_path):
    """The unit is text of a file: one with a line break wrote an element into the header."""
    made = moving_scene()
    record = msgspec.structs.replace(made.record, unit="mm\nelement vertex 3")
    export(MovingScene(record, made.model), tmp_path / "a.ply", Times(times=(np.float64(0.4),)))
    data = plyfile.PlyData.read(tmp_path / "a.ply")
    assert "lengths in mm element vertex 3" in data.comments and "time 0.4" in data.comments


def test_gaussians_of_another_writer_are_read(tmp_path):
    """Float64, degree 0, properties in another order, one number that is not finite."""
    names = ["opacity", "x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2"]
    names += ["f_dc_0", "f_dc_1", "f_dc_2"]
    vertices = np.zeros(3, [(name, "f8") for name in names])
    vertices["x"], vertices["rot_0"], vertices["y"] = [1, 2, np.nan], 1, [0, 1e60, 0]
    out = io.BytesIO()
    plyfile.PlyData([plyfile.PlyElement.describe(vertices, "vertex")], byte_order="<").write(out)
    (tmp_path / "a.ply").write_bytes(out.getvalue())
    found = read_gaussians(tmp_path / "a.ply")
    assert found.count == 1 and found.position[0, 0] == 1 and found.harmonics.shape == (1, 3, 1)


def test_a_trained_scene_whose_positions_are_one_number_is_refused(tmp_path):
    shapes = {name: (2, *rest) for name, rest in ARRAYS.items()}
    np.savez(tmp_path / "a.npz", **{name: np.zeros(shape) for name, shape in shapes.items()})
    assert read_arrays(tmp_path / "a.npz")["xyz"].shape == (2, 3)
    for name in shapes:
        np.savez(tmp_path / "a.npz", **{n: np.zeros(() if n == name else shape) for n, shape in shapes.items()})
        with pytest.raises(InputError, match=f"{name} has shape"):
            read_arrays(tmp_path / "a.npz")
