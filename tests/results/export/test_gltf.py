"""Animated points: read back by the rules of glTF, they lie where the scene has them at every time."""

import json
import struct

import msgspec
import numpy as np
import pytest
from made_up_model import moving_scene

from endotsr.errors import InputError
from endotsr.results.export import gltf
from endotsr.results.export.files import Content, export
from endotsr.results.export.placement import placed_points
from endotsr.results.export.scene import MovingScene
from endotsr.results.export.times import Times

TYPES = {5126: np.dtype("<f4"), 5123: np.dtype("<u2")}
ROWS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def read(file):
    """The description, and a function that gives the array of an accessor."""
    content = file.read_bytes()
    magic, version, length, size, kind = struct.unpack_from("<4sIII4s", content)
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
    about, data = json.loads(content[20 : 20 + size]), content[28 + size :]
    assert content[24 + size : 28 + size] == b"BIN\0" and about["buffers"] == [{"byteLength": len(data)}]

    def array(number):
        accessor = about["accessors"][number]
        view, rows = about["bufferViews"][accessor["bufferView"]], ROWS[accessor["type"]]
        found = np.frombuffer(data, TYPES[accessor["componentType"]], accessor["count"] * rows, view["byteOffset"])
        assert view["byteLength"] == found.nbytes and view["byteOffset"] % 4 == 0
        return found.reshape(-1, rows)

    return about, array


def timed(duration):
    scene = moving_scene()
    return MovingScene(msgspec.structs.replace(scene.record, duration=duration), scene.model)


def test_points_move_as_the_scene_does(tmp_path):
    scene, times = timed(2.0), (0.25, 0.4, 0.9)
    said = export(scene, tmp_path / "a.glb", Times(times), Content(least_opacity=0.6))
    about, array = read(tmp_path / "a.glb")
    (primitive,) = about["meshes"][0]["primitives"]
    base, targets = array(primitive["attributes"]["POSITION"]), [array(t["POSITION"]) for t in primitive["targets"]]
    (sampler,) = about["animations"][0]["samplers"]
    seconds, weights = array(sampler["input"])[:, 0], array(sampler["output"]).reshape(3, 2)
    assert seconds == pytest.approx([0, 0.3, 1.3])
    for time, row in zip(times, weights, strict=True):
        moment = scene.at(time)
        chosen = 1 / (1 + np.exp(-moment.opacity_logit)) >= 0.6
        shown = base + sum(w * t for w, t in zip(row, targets, strict=True))
        assert np.allclose(shown, placed_points(moment.position, scene.placement)[:, chosen].T, atol=1e-5)
    assert f"{len(base)} points at 3 times" in said
    bounds = about["accessors"][primitive["attributes"]["POSITION"]]
    assert bounds["min"] == base.min(axis=0).tolist() and bounds["max"] == base.max(axis=0).tolist()
    assert about["nodes"][0]["rotation"] == [1, 0, 0, 0] and about["nodes"][0]["scale"] == [0.001] * 3, "mm"


def test_another_program_reads_the_same_points(tmp_path):
    """trimesh: metres, y up, z backward; `in_blender.py` compares the animation as well."""
    trimesh = pytest.importorskip("trimesh")
    scene = timed(2.0)
    export(scene, tmp_path / "a.glb", Times((0.25, 0.9)), Content(least_opacity=0.6))
    loaded = trimesh.load_scene(tmp_path / "a.glb")
    (node,) = loaded.graph.nodes_geometry
    placed, name = loaded.graph[node]
    moment = scene.at(0.25)
    chosen = 1 / (1 + np.exp(-moment.opacity_logit)) >= 0.6
    x, y, z = placed_points(moment.position, scene.placement)[:, chosen] / 1e3
    found = trimesh.transform_points(loaded.geometry[name].vertices, placed)
    assert np.allclose(found, np.stack([x, -y, -z], axis=1), atol=1e-8)
    assert len(loaded.geometry[name].colors) == len(found)


def test_colours_are_linear(tmp_path):
    scene = timed(0.0)
    export(scene, tmp_path / "a.glb", Times((0.4,)))
    about, array = read(tmp_path / "a.glb")
    export(scene, tmp_path / "a.ply", Times((0.4,)), Content("points"))
    vertex = np.frombuffer((tmp_path / "a.ply").read_bytes().split(b"end_header\n")[1], "<f4,<f4,<f4,u1,u1,u1")
    (primitive,) = about["meshes"][0]["primitives"]
    colours = array(primitive["attributes"]["COLOR_0"])
    shown = np.stack([vertex[f"f{k}"] for k in (3, 4, 5)], axis=1) / 255
    assert (colours[:, 3] == 65535).all() and np.allclose(colours[:, :3] / 65535, shown**2.2, atol=0.01)
    assert "targets" not in primitive and "animations" not in about


def test_without_a_rate_a_frame_takes_a_fifteenth_of_a_second(tmp_path):
    scene = timed(0.0)
    export(scene, tmp_path / "a.glb", Times())
    about, array = read(tmp_path / "a.glb")
    assert np.diff(array(about["animations"][0]["samplers"][0]["input"])[:, 0]) == pytest.approx(1 / 15)


@pytest.mark.parametrize(
    ("times", "content", "said"),
    [((0.5, 0.2), Content(), "must ascend"), ((0.5, 0.6, 0.6 + 1e-12), Content(), "must ascend"),
     ((0.5,), Content("mesh"), "a .glb stores points"),
     ((0.5,), Content(least_opacity=1.0), "no Gaussian has opacity 1 or more")],
)  # fmt: skip
def test_points_that_cannot_be_animated_are_refused(times, content, said, tmp_path):
    with pytest.raises(InputError, match=said):
        export(moving_scene(), tmp_path / "a.glb", Times(times), content)
    assert not list(tmp_path.iterdir())


def test_the_weights_of_many_times_count_towards_the_largest_file(tmp_path, monkeypatch):
    """The weights grow with the square of the times; the length of such a file did not fit into its header."""
    scene = moving_scene()
    monkeypatch.setattr(gltf, "LARGEST", 12 * 80 * 202)
    with pytest.raises(InputError, match="at 200 times need more than"):
        export(scene, tmp_path / "a.glb", Times(count=200), Content(least_opacity=0.0))
    assert export(scene, tmp_path / "a.glb", Times(count=20), Content(least_opacity=0.0))
