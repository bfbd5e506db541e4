"""The surface of a scene: where it is, which way it faces, and what other programs read."""

import sys

import numpy as np
import pytest
from made_up_model import CAMERA, moving_scene

from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera
from endotsr.results.export import mesh
from endotsr.results.export.files import Content, export
from endotsr.results.export.mesh import DepthView, fused
from endotsr.results.export.times import Times

pytest.importorskip("skimage", reason="scikit-image, which extracts the surface, is not installed")
CENTRE, RADIUS = np.array([0.2, -0.3, 10.0]), 3.0
SIDE = 0.2


def turned_camera(angle):
    """A camera 10 units from the middle of the sphere, turned about it."""
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    return Camera(rotation, np.array([0, 0, 10.0]) - rotation @ CENTRE, 120.0, 110.0, 48.0, 40.0, 96, 80)


def sphere_view(angle):
    """The depth of a sphere that a camera sees, from the formula; its colour tells left from right."""
    camera = turned_camera(angle)
    row, column = np.mgrid[:80, :96] + 0.5
    ray = np.stack([(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones_like(row)])
    middle = camera.rotation @ CENTRE + camera.translation
    along, square = np.tensordot(middle, ray, 1), (ray**2).sum(axis=0)
    under_root = along**2 - square * (middle @ middle - RADIUS**2)
    depth = np.where(under_root > 0, (along - np.sqrt(np.maximum(under_root, 0))) / square, 0)
    points = camera.rotation.T @ ((ray * depth).reshape(3, -1) - np.asarray(camera.translation)[:, None])
    shade = np.where(points[0].reshape(depth.shape) > CENTRE[0], 0.75, 0.25)
    return DepthView(camera, depth, np.broadcast_to(shade, (3, *depth.shape)))


@pytest.mark.parametrize("angles", [(0.0,), (-0.5, 0.0, 0.6)])
def test_the_surface_of_a_sphere_is_found(angles):
    found = fused([sphere_view(a) for a in angles], SIDE)
    # A camera looks at the rim of the sphere along its surface: what it sees better is judged.
    facing = (found.vertices - CENTRE) @ turned_camera(0.0).rotation[2] < -0.5 * RADIUS
    distance = np.linalg.norm(found.vertices - CENTRE, axis=1)[facing] - RADIUS
    assert facing.sum() > 300 and np.abs(distance).max() < 0.5 * SIDE and abs(distance.mean()) < 0.1 * SIDE


def test_triangles_face_the_camera():
    found = fused([sphere_view(0.0)], SIDE)
    a, b, c = (found.vertices[found.faces[:, k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    facing = (a - CENTRE)[:, 2] < -0.5 * RADIUS
    assert facing.any() and (((a - CENTRE) * normal).sum(axis=1)[facing] > 0).mean() > 0.99


def test_more_cameras_show_more_of_it():
    one, three = (fused([sphere_view(a) for a in angles], SIDE) for angles in ((0.0,), (-0.9, 0.0, 0.9)))
    assert np.ptp(three.vertices[:, 0]) >= np.ptp(one.vertices[:, 0]) and len(three.faces) > 1.15 * len(one.faces)


def test_colours_are_those_of_the_views():
    found = fused([sphere_view(0.0)], SIDE)
    x = found.vertices[:, 0] - CENTRE[0]
    facing = found.vertices[:, 2] < CENTRE[2] - 0.5 * RADIUS
    assert (found.colours[facing & (x > SIDE)] == 191).all() and (found.colours[facing & (x < -SIDE)] == 64).all()


def test_trimesh_reads_a_surface(tmp_path):
    trimesh = pytest.importorskip("trimesh", reason="trimesh, an outside reader of meshes, is not installed")
    said = export(dense_scene(), tmp_path / "a.ply", Times(times=(0.4,)), Content("mesh"))
    read = trimesh.load(tmp_path / "a.ply", process=False)
    found = mesh.surface(dense_scene(), 0.4)
    assert f"{len(found.faces)} triangles at time 0.4" in said
    assert np.array_equal(read.faces, found.faces) and np.array_equal(read.vertices.astype("f4"), found.vertices)
    assert np.array_equal(read.visual.vertex_colors[:, :3], found.colours)


def dense_scene():
    """A made-up scene whose Gaussians are large and opaque enough to be a surface."""
    scene = moving_scene(300)
    scene.model.gaussians.opacity_logit[:] = 3
    scene.model.gaussians.log_scale[:] += 0.7
    return scene


def test_the_vertices_lie_on_the_rendered_depth():
    scene = dense_scene()
    found, out = mesh.surface(scene, 0.4), scene.render(0.4, CAMERA)
    seen = np.where(out.opacity > 0.5, out.depth / np.maximum(out.opacity, 1e-9), 0)
    x, y, z = found.vertices.T
    u, v = np.floor(x / z * CAMERA.fx + CAMERA.cx).astype(int), np.floor(y / z * CAMERA.fy + CAMERA.cy).astype(int)
    inside = (u > 0) & (v > 0) & (u < CAMERA.width - 1) & (v < CAMERA.height - 1)
    near = np.min(
        [np.abs(seen[v[inside] + i, u[inside] + j] - z[inside]) for i in (-1, 0, 1) for j in (-1, 0, 1)], axis=0
    )
    assert inside.sum() > 100 and np.quantile(near, 0.95) < 0.5


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (Content("mesh", voxel=1e-6), "--voxel 1e-06 is not allowed"),
        (Content("mesh", voxel=-1.0), "--voxel -1 is not allowed"),
        (Content("mesh", voxel=float("nan")), "--voxel nan is not allowed"),
        (Content("mesh", voxel=1e3), "no surface in a grid of .* voxels of side 1e.03; use a smaller --voxel"),
        (Content("points", voxel=1.0), "with --content mesh"),
    ],
)
def test_what_is_no_mesh_is_refused(content, said, tmp_path):
    with pytest.raises(InputError, match=said):
        export(dense_scene(), tmp_path / "a.ply", Times(times=(0.4,)), content)
    assert list(tmp_path.iterdir()) == []


def test_a_scene_without_depth_has_no_surface(tmp_path):
    scene = moving_scene()
    scene.model.gaussians.opacity_logit[:] = -8
    with pytest.raises(InputError, match="no surface at this time"):
        export(scene, tmp_path / "a.ply", Times(times=(0.4,)), Content("mesh"))


def test_without_scikit_image_the_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "skimage.measure", None)
    with pytest.raises(InputError, match=r"pip install 'endotsr\[mesh\]'"):
        fused([sphere_view(0.0)], SIDE)
