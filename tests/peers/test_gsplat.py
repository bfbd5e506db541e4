"""The rasteriser against gsplat's pure-torch reference and torch autograd: images and every gradient block in float64.

Needs torch (the CPU build is enough) and gsplat, `pip install '.[peers]'`; skipped without.
"""

import numpy as np
import pytest
from made_up_scenes import random_scene, turned_camera
from pages.bench import gsplat as peer_gsplat

from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT, PAPER, LegacyDeviations

REASON = peer_gsplat.available()
needs_gsplat = pytest.mark.skipif(REASON is not None, reason=f"torch and gsplat (extra `peers`): {REASON}")
BOUND = 1e-9
LIKE_GSPLAT = PAPER._replace(alpha_max=peer_gsplat.ALPHA_MAX)
RULES = {
    "exact": EXACT,
    "paper": PAPER,
    "its own clamp": LIKE_GSPLAT,
    "no stop": LIKE_GSPLAT._replace(transmittance_stop=0),
}
CASES = [("exact", 0, "definition"), ("exact", 3, "definition")]  # the fast path needs a cutoff
CASES += [
    (*case, path) for case in (("paper", 2), ("its own clamp", 3), ("no stop", 1)) for path in ("definition", "blocks")
]
BLOCKS = ("position", "quaternion", "log_scale", "opacity_logit", "harmonics")
BACKGROUND = np.array([0.2, 0.5, 0.9])


def centred(width: int, height: int) -> Camera:
    """Turned, with the principal point in the middle: there both programs clamp the Jacobian at the same place."""
    return turned_camera(width, height, 24.0)._replace(cx=width / 2, cy=height / 2)


def scene_for(name: str, seed: int, camera: Camera):
    """Gaussians behind the camera, opaque ones, and, where both clamp the Jacobian, centres beyond that limit."""
    scene = random_scene(seed, 60, camera, size=(0.5, 6.0))._replace(residual=None)
    limit = 0.95 if name == "paper" else 0.99
    scene.opacity_logit[:] = np.minimum(scene.opacity_logit, np.log(limit / (1 - limit)))
    if name in ("its own clamp", "no stop"):
        scene.opacity_logit[5:9] = 8.0  # alpha 0.9997, clamped
    seen = camera.rotation @ scene.position + camera.translation[:, None]
    inside = (
        1.2 * np.array([camera.width / (2 * camera.fx), camera.height / (2 * camera.fy)])[:, None] * np.abs(seen[2])
    )
    seen[:2] = np.clip(seen[:2], -inside, inside)
    if name != "exact":
        seen[0, 1:5] = np.abs(seen[2, 1:5]) * [1.2, -1.2, 0.2, 0.1]
        seen[1, 1:5] = np.abs(seen[2, 1:5]) * [0.2, 0.1, 1.2, -1.2]
        scene.log_scale[:, 1:5] = np.log(np.abs(seen[2, 1:5]) * 0.4)
    scene.position[:] = camera.rotation.T @ (seen - camera.translation[:, None])
    return scene


@needs_gsplat
@pytest.mark.parametrize("name, degree, path", CASES)
def test_image_depth_and_every_gradient_equal_torch_autograd(name, degree, path):
    settings = RULES[name]
    camera = centred(33, 29)
    scene = scene_for(name, degree, camera)
    rng = np.random.default_rng(degree)
    d_colour, d_depth = rng.normal(0, 1, (3, 29, 33)), rng.normal(0, 0.1, (29, 33))
    out, saved = render_forward(scene, camera, settings, degree=degree, background=BACKGROUND, compositor=path)
    ours = render_reverse(d_colour, d_depth, None, saved)
    peer = peer_gsplat.render_with_gradients(
        scene, camera, settings, d_colour, d_depth, degree=degree, background=BACKGROUND
    )
    assert np.ptp(out.colour) > 0.3 and (out.opacity > 0.1).mean() > 0.5
    for mine, theirs in ((out.colour, peer.colour), (out.depth, peer.depth)):
        assert np.abs(mine - theirs).max() <= BOUND * np.abs(theirs).max()
    for block in BLOCKS:
        mine, theirs = getattr(ours, f"d_{block}"), peer.gradients[block]
        assert np.linalg.norm(theirs) > 1e-3, block
        assert np.linalg.norm(mine - theirs) <= BOUND * np.linalg.norm(theirs), block


@needs_gsplat
def test_the_comparison_sees_a_gradient_that_is_one_part_in_a_million_off():
    camera = centred(33, 29)
    scene = scene_for("exact", 3, camera)
    d_colour, d_depth = np.ones((3, 29, 33)), np.ones((29, 33))
    _, saved = render_forward(scene, camera, EXACT)
    ours = render_reverse(d_colour * (1 + 1e-6), d_depth, None, saved)
    peer = peer_gsplat.render_with_gradients(scene, camera, EXACT, d_colour, d_depth)
    for block in BLOCKS:
        theirs = peer.gradients[block]
        assert np.linalg.norm(getattr(ours, f"d_{block}") - theirs) > 10 * BOUND * np.linalg.norm(theirs), block


def test_rules_that_gsplat_does_not_have_are_named():
    """No comparison is made silently between two different rules."""
    camera = centred(33, 29)
    scene = scene_for("exact", 0, camera)
    assert peer_gsplat.difference_of_rules(scene, camera, EXACT) is None
    cases = [
        ("3 sigma", scene, EXACT._replace(support="three_sigma_tiles")),
        ("deviations", scene, EXACT._replace(deviations=LegacyDeviations(conic_epsilon=True))),
        ("residual", scene._replace(residual=np.zeros((3, 60))), EXACT),
        ("clamped at", scene._replace(opacity_logit=np.full(60, 8.0)), PAPER),
        ("Jacobian", scene_for("paper", 0, camera), EXACT),
        ("Jacobian", scene_for("paper", 0, camera), PAPER._replace(jacobian_clamp=1.0)),
    ]
    for word, given, settings in cases:
        assert word in str(peer_gsplat.difference_of_rules(given, camera, settings)), word
