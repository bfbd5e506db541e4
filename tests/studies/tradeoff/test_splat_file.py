"""Files of Gaussians: both formats, and one line for what cannot be used."""

import numpy as np
import pytest

from endotsr.errors import InputError
from endotsr.method.kernels.constants import Y00
from endotsr.method.splatting.render import Scene, render_forward
from endotsr.method.splatting.settings import PAPER
from endotsr.studies.tradeoff.scenes import read_splats, splat_scene


def write_ply(path, count=12, bands=4, text=False, seed=0):
    rng = np.random.default_rng(seed)
    names = ["x", "y", "z", "nx", "f_dc_0", "f_dc_1", "f_dc_2", *(f"f_rest_{i}" for i in range(3 * (bands - 1)))]
    names += ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    vertex = np.zeros(count, [(name, "<f4") for name in names])
    for name in names:
        vertex[name] = rng.normal(size=count)
    header = [f"format {'ascii' if text else 'binary_little_endian'} 1.0", f"element vertex {count}"]
    header += [f"property float {name}" for name in names]
    path.write_bytes("\n".join(["ply", *header, "end_header", ""]).encode() + vertex.tobytes())
    return vertex


def test_ply(tmp_path):
    vertex = write_ply(tmp_path / "a.ply")
    g = read_splats(tmp_path / "a.ply")
    assert g.count == 12 and g.position.dtype == np.float32
    np.testing.assert_array_equal(g.position[1], vertex["y"])
    np.testing.assert_array_equal(g.quaternion[0], vertex["rot_0"])
    np.testing.assert_array_equal(g.log_scale[2], vertex["scale_2"])
    np.testing.assert_array_equal(g.opacity_logit, vertex["opacity"])
    np.testing.assert_array_equal(g.harmonics[0, 1], vertex["f_dc_1"])
    np.testing.assert_array_equal(g.harmonics[1, 0], vertex["f_rest_0"])  # all of red first
    np.testing.assert_array_equal(g.harmonics[3, 2], vertex["f_rest_8"])


def write_npz(path, count=30, **changes):
    rng = np.random.default_rng(1)
    data = {
        "xyz": rng.normal(size=(count, 3)).astype(np.float32), "log_scale": np.full((count, 3), -2, np.float32),
        "quat_wxyz": rng.normal(size=(count, 4)).astype(np.float32), "rgb": rng.random((count, 3), dtype=np.float32),
        "opacity": np.linspace(0, 1, count, dtype=np.float32),
    }  # fmt: skip
    np.savez(path, **(data | changes))
    return data


def test_npz(tmp_path):
    data = write_npz(tmp_path / "a.npz")
    g = read_splats(tmp_path / "a.npz")
    np.testing.assert_allclose(g.harmonics[0].T * Y00 + 0.5, data["rgb"], atol=1e-6)
    opacity = 1 / (1 + np.exp(-g.opacity_logit.astype(float)))
    np.testing.assert_allclose(opacity, data["opacity"], atol=0.5 / 255 + 1e-6)
    assert np.isfinite(g.opacity_logit).all()


def test_the_camera_sees_the_scene(tmp_path):
    write_npz(tmp_path / "a.npz", count=300)
    scene = splat_scene(tmp_path / "a.npz", side=64)
    out, saved = render_forward(Scene(*scene.gaussians[:5]), scene.camera, PAPER._replace(near=scene.near), degree=0)
    u, v = saved.projected.mean2d
    assert saved.projected.visible.mean() > 0.97
    assert np.mean((u > 0) & (u < 64) & (v > 0) & (v < 64)) > 0.9
    assert out.opacity.mean() > 0.2


def test_gaussians_that_are_not_finite_are_left_out(tmp_path):
    xyz = np.zeros((30, 3), np.float32)
    xyz[4, 1] = np.nan
    write_npz(tmp_path / "a.npz", xyz=xyz)
    assert read_splats(tmp_path / "a.npz").count == 29


def test_refusals(tmp_path):
    write_ply(tmp_path / "text.ply", text=True)
    write_ply(tmp_path / "bands.ply", bands=3)
    (tmp_path / "empty.ply").write_bytes(b"")
    (tmp_path / "a.npz").write_bytes(b"no zip")
    np.savez(tmp_path / "less.npz", xyz=np.zeros((2, 3)))
    write_npz(tmp_path / "nan.npz", xyz=np.full((30, 3), np.nan))
    whole = tmp_path / "cut.ply"
    write_ply(whole)
    whole.write_bytes(whole.read_bytes()[:-50])
    reasons = {
        "text.ply": "lines of 24 numbers", "bands.ply": "6 f_rest columns", "empty.ply": "not a",
        "a.npz": "not an .npz file", "less.npz": "is missing", "nan.npz": "no Gaussian with finite numbers",
        "cut.ply": "cannot be read", "missing.ply": "No such file", "x.txt": "ends in .ply or .npz",
    }  # fmt: skip
    for name, reason in reasons.items():
        with pytest.raises(InputError, match=reason) as caught:
            read_splats(tmp_path / name)
        assert name in str(caught.value)
