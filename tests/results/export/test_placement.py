"""The axes of what is written: those of the first camera, whatever the world of the training was."""

import json

import msgspec
import numpy as np
import pytest
from made_up_model import CAMERA, moving_scene
from scipy.spatial.transform import Rotation

from endotsr.clips.sequences.record import recorded
from endotsr.errors import InputError
from endotsr.method.splatting.camera import project
from endotsr.method.splatting.harmonics import harmonics_forward
from endotsr.method.splatting.render import Scene
from endotsr.results.export import placement
from endotsr.results.export.files import Content, export
from endotsr.results.export.ply import read_gaussians
from endotsr.results.export.scene import MovingScene, facing_camera, open_scene
from endotsr.results.export.times import Times
from endotsr.results.views.pictures import Look, rendered, requested_views, write_pictures
from endotsr.results.views.plan import ViewRequest
from endotsr.training.scene.gaussians import Gaussians

plyfile = pytest.importorskip("plyfile", reason="plyfile, an outside reader of ply files, is not installed")
ENDONERF = np.diag([1.0, -1.0, -1.0])  # world-to-camera of a resting EndoNeRF camera: y up, z backward
OBLIQUE = Rotation.from_euler("xyz", [0.7, -1.1, 2.0]).as_matrix()
POSES = {
    "EndoNeRF": (ENDONERF, np.zeros(3)),
    "any": (OBLIQUE, np.array([3.0, -4.0, 25.0])),
    "identity": (np.eye(3), np.zeros(3)),
}
TIME = 0.0


def in_world(scene: Scene, rotation, translation) -> Scene:
    """The Gaussians, given in the axes of the camera, in a world whose camera has this pose; by the formulas alone."""
    position = rotation.T @ (scene.position - translation[:, None])
    back = Rotation.from_matrix(rotation.T)
    quaternion = (back * Rotation.from_quat(scene.quaternion.T, scalar_first=True)).as_quat(scalar_first=True).T
    return scene._replace(position=position, quaternion=quaternion)


def scene_seen_by(pose) -> MovingScene:
    """A still scene in front of a camera with this pose; colours of degree 0, so that a turn does not touch them."""
    made, (rotation, translation) = moving_scene(), POSES[pose]
    still = made.at(TIME)
    still = still._replace(harmonics=still.harmonics * (np.arange(16) == 0)[:, None, None])
    placed = in_world(still, rotation, translation)
    gaussians = Gaussians(
        *(np.ascontiguousarray(a, np.float32) for a in (placed.position, placed.quaternion, placed.log_scale)),
        placed.opacity_logit, placed.harmonics,
    )  # fmt: skip
    cameras = recorded([CAMERA._replace(rotation=rotation, translation=translation)])
    model = made.model._replace(gaussians=gaussians)
    return MovingScene(msgspec.structs.replace(made.record, cameras=cameras), model)


def plain() -> Scene:
    return scene_seen_by("identity").at(TIME)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("content", ["gaussians", "points", "mesh"])
def test_an_outside_reader_finds_z_forward_and_y_down(pose, content, tmp_path):
    if content == "mesh":
        pytest.importorskip("skimage")
    scene = scene_seen_by(pose)
    scene.model.gaussians.opacity_logit[:] = 3
    scene.model.gaussians.log_scale[:] += 0.5
    export(scene, tmp_path / "a.ply", Times(times=(TIME,)), Content(content))
    data = plyfile.PlyData.read(tmp_path / "a.ply")
    found = np.stack([data["vertex"].data[name] for name in "xyz"])
    assert 5 < found[2].mean() < 12 and any("x right, y down, z forward" in c for c in data.comments)
    if content == "mesh":
        seen = scene.render(TIME, scene.cameras[0])
        u, v = (np.floor(found[k] / found[2] * 60 + c).astype(int) for k, c in ((0, 32), (1, 24)))
        inside = (u >= 0) & (u < 64) & (v >= 0) & (v < 48)
        assert inside.mean() > 0.9 and (seen.opacity[v[inside], u[inside]] > 0.3).mean() > 0.95
    else:
        np.testing.assert_allclose(found, plain().position, atol=1e-4)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("source", ["run", "slim", "ply"])
def test_the_identity_camera_of_a_file_shows_the_first_frame(pose, source, tmp_path):
    scene = scene_seen_by(pose)
    seen = scene.render(TIME, scene.cameras[0]).colour
    if source != "run":
        name = tmp_path / f"a.{'npz' if source == 'slim' else 'ply'}"
        export(scene, name, *([Times(times=(TIME,))] if source == "ply" else []))
        scene = open_scene(name)
    entry = {key: value for key, value in CAMERA._asdict().items() if key not in ("rotation", "translation")}
    path = {"cameras": [entry | {"rotation": np.eye(3).tolist(), "translation": [0, 0, 0]}]}
    (tmp_path / "path.json").write_text(json.dumps(path))
    views = requested_views(scene, ViewRequest(Times(times=(TIME,)), str(tmp_path / "path.json")), "test")
    shown = next(rendered(scene, views, Look()))[1].colour
    assert np.abs(shown - seen).mean() < 2e-3 and shown.max() > 0.1


@pytest.mark.parametrize("pose", POSES)
def test_a_camera_of_render_json_is_in_the_same_axes(pose, tmp_path):
    scene = scene_seen_by(pose)
    request = ViewRequest(Times(times=(TIME, 0.3)), offset=(0.5, 0.0, 0.0))
    write_pictures(tmp_path / "a", scene, rendered(scene, requested_views(scene, request, "test"), Look()), Look())
    entry = json.loads((tmp_path / "a/render.json").read_text())["pictures"][0]["camera"]
    np.testing.assert_allclose(entry["rotation"], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(entry["translation"], [-0.5, 0, 0], atol=1e-12)


def test_a_scene_of_a_ply_file_keeps_its_axes(tmp_path):
    export(scene_seen_by("any"), tmp_path / "a.ply", Times(times=(TIME,)))
    export(open_scene(tmp_path / "a.ply"), tmp_path / "c.ply", Times(times=(0.0,)))
    found = read_gaussians(tmp_path / "c.ply").position
    np.testing.assert_array_equal(found, read_gaussians(tmp_path / "a.ply").position)
    with pytest.raises(InputError, match="a slim model cannot be made from"):
        export(open_scene(tmp_path / "a.ply"), tmp_path / "b.npz")


def test_colours_turn_with_the_scene():
    """The colour from every side, of degree 3, is that of the scene before it was turned."""
    rng = np.random.default_rng(2)
    scene = moving_scene().at(0.3)
    turned = placement.placed_scene(scene, placement.Placement(OBLIQUE, np.array([1.0, 2.0, 3.0])))
    for centre in rng.normal(0, 30, (5, 3)):
        a = harmonics_forward(scene.harmonics.astype("f8"), None, scene.position.astype("f8"), centre, 3)[0]
        there = OBLIQUE @ centre + [1.0, 2.0, 3.0]
        b = harmonics_forward(turned.harmonics.astype("f8"), None, turned.position.astype("f8"), there, 3)[0]
        np.testing.assert_allclose(a, b, atol=1e-5)


def test_an_endonerf_world_is_turned_without_rounding():
    """Half a turn about x changes signs alone, so that nothing is lost."""
    scene = moving_scene().at(0.3)
    turned = placement.placed_scene(scene, placement.Placement(ENDONERF, np.zeros(3)))
    for name in ("position", "quaternion", "harmonics"):
        before, after = (np.sort(np.abs(getattr(one, name)), axis=0) for one in (scene, turned))
        np.testing.assert_array_equal(after, before)
    assert placement.placed_scene(scene, placement.HERE) is scene


def test_the_axes_of_a_ply_file_are_not_said_to_be_those_of_a_camera(tmp_path):
    """A file of another program has axes of its own, and the export keeps them."""
    export(scene_seen_by("EndoNeRF"), tmp_path / "a.ply", Times(times=(TIME,)))
    export(open_scene(tmp_path / "a.ply"), tmp_path / "b.ply", Times(), Content("points"))
    (said,) = [c for c in plyfile.PlyData.read(tmp_path / "b.ply").comments if c.startswith("axes")]
    assert said == "axes: those of the ply file that this file was made from"


def test_a_corrected_pose_of_the_first_frame_is_the_one_of_the_exports():
    """The first camera of sequence.json is not corrected; the placement is that of the corrected one."""
    made = moving_scene(exposure=True)
    turn = np.tile(np.float32([[0.1], [0.0], [0.0]]), 3)
    frames = made.model.frames._replace(pose_rotation=turn, pose_translation=turn)
    scene = MovingScene(made.record, made.model._replace(frames=frames))
    recorded_first = placement.placement_of(scene.record.frame_cameras[0])
    assert np.abs(scene.placement.rotation - recorded_first.rotation).max() > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_the_facing_camera_shows_the_middle_of_every_axis(seed):
    """The positions between the quantiles 2 % and 98 % of every axis are in the picture."""
    rng = np.random.default_rng(seed)
    position = rng.standard_t(1 + seed, (3, 20000)) * rng.uniform(0.1, 10, (3, 1))
    camera = facing_camera(position, 512)
    low, high = np.quantile(position, [0.02, 0.98], axis=1)
    u, v, z = project(camera, position)
    shown = (z > 0) & (u >= 0) & (u <= 512) & (v >= 0) & (v <= 512)
    assert shown[((position.T >= low) & (position.T <= high)).all(axis=1)].all()
