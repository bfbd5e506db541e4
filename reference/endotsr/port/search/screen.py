"""Decisions that another rasteriser of Gaussians may take, each as a change of the definition.

Another program may have another support, other activations or other signs, or leave out a part of the reverse pass of
compositing. `conventions.py` makes the changes.
"""

from endotsr.port.search.conventions import Convention

_VISIBLE = "projection.projection_forward"
_NEAR = "point[2].real > settings.near"
_LAYERS = "compositing.layers_of"
_WANTED = "live & box & ~(alpha.real < settings.alpha_cutoff)"
_ALL = ("compositing.reach_ellipse", "return (squared >= 0) &", "return np.ones_like(squared, bool) |")
_MIDDLE = "(a[i] + c[i]) / 2"
_RADIUS = f"np.ceil(3 * np.sqrt({_MIDDLE} + np.sqrt(max(0.1, ({_MIDDLE}) ** 2 - projected.determinant[i]))))"
_COMPOSED, _SUMMED = "compositing.composite_forward", "depth = depth + weight * projected.depth[layer.index]"
_POLYNOMIALS = "harmonics.POLYNOMIALS"
_REVERSE = "compositing.composite_reverse"
_POWER = "value * front * (own - rest)"
_PASSES = "taken & ~(value > settings.alpha_max)"


def _wanted(said: str, condition: str) -> Convention:
    """Another condition for drawing a visible Gaussian at a pixel, in place of cutoff and support."""
    return Convention(said, ((_LAYERS, _WANTED, f"live & projected.visible[i] & {condition}"), _ALL))


def _culled(said: str, condition: str) -> Convention:
    """Another condition for drawing a Gaussian at a pixel, beside those of the method."""
    return Convention(said, ((_LAYERS, _WANTED, f"{_WANTED} & ({condition})"),))


def _tiles(size: int) -> Convention:
    name = "compositing.reach_tiles"
    changes = (
        ("radius) / 16", f"radius) / {size}"),
        ("radius + 15) / 16", f"radius + {size - 1}) / {size}"),
        ("(at // 16 >= first) & (at // 16 < last)", f"(at // {size} >= first) & (at // {size} < last)"),
    )
    return Convention(f"tiles of {size} pixels, not of 16", tuple((name, *change) for change in changes))


def _depth(said: str, depth: str) -> Convention:
    """The depth of one Gaussian in the place of the sum of all."""
    return Convention(f"the depth {said}, not the sum of weighted depths", ((_COMPOSED, _SUMMED, f"depth = {depth}"),))


def _radius(said: str, radius: str) -> Convention:
    return Convention(f"the radius of the tiles {said}", (
        ("compositing.reach_tiles", "np.ceil(3 * np.sqrt(longest))", radius),
    ))  # fmt: skip


OF_THE_SCREEN: tuple[Convention, ...] = (
    # which Gaussians are drawn, and where
    _wanted("no cutoff of alpha: Gaussians drawn beyond their support", "(alpha.real > 0)"),
    _culled("nothing drawn beyond three standard deviations (the ellipse of 3 sigma)", "q.real <= 9"),
    _culled("nothing drawn outside of the circle of radius ceil(3 sqrt(lambda))", f"dx**2 + dy**2 <= {_RADIUS} ** 2"),
    _culled(
        "nothing drawn outside of the square of half side ceil(3 sqrt(lambda))",
        f"np.maximum(np.abs(dx), np.abs(dy)) <= {_RADIUS}",
    ),
    _tiles(8),
    _tiles(32),
    _radius("not rounded up", "3 * np.sqrt(longest)"),
    _radius("rounded down", "np.floor(3 * np.sqrt(longest))"),
    _radius("that of each axis of the image", "np.ceil(3 * np.sqrt(projected.covariance2d[2 * axis].real))"),
    Convention("Gaussians culled whose slope is beyond 1.3 times the field of view", (
        (_VISIBLE, _NEAR, f"({_NEAR}) & (np.abs(point[0].real / point[2].real) < 0.65 * camera.width / camera.fx)"
                          " & (np.abs(point[1].real / point[2].real) < 0.65 * camera.height / camera.fy)"),
    )),
    Convention("Gaussians culled whose centre is outside of the image", (
        (_VISIBLE, _NEAR, f"({_NEAR}) & (np.abs(camera.fx * point[0].real / point[2].real + camera.cx"
                          " - camera.width / 2) < camera.width / 2) & (np.abs(camera.fy * point[1].real"
                          " / point[2].real + camera.cy - camera.height / 2) < camera.height / 2)"),
    )),
    Convention("the Gaussian that ends the light still drawn: the stop decided by the transmittance in front of it", (
        (_LAYERS, "(t * (1 - alpha)).real < settings", "t.real < settings"),
    )),
    Convention("no stop of the light at a small transmittance", (
        (_LAYERS, "< settings.transmittance_stop", "< -1"),
    )),
    # what a Gaussian is
    Convention("the opacity compensated for the low-pass, by the root of det without it / det with it", (
        (_LAYERS, "value = opacity[i] *", "value = opacity[i] * np.sqrt(np.maximum(0, ((a[i] - settings.low_pass)"
                  " * (c[i] - settings.low_pass) - b[i] ** 2) / projected.determinant[i])) *"),
    )),
    Convention("the sigmoid of the opacity missing: the logit taken as the opacity", (
        (_LAYERS, "opacity_of(opacity_logit)", "opacity_logit"), _ALL,
    )),
    Convention("the exponential of the log-scale missing: the logarithm taken as the scale", (
        ("covariance.covariance_forward", "np.exp(np.where(", "(np.where("),
    )),
    Convention("the quaternion not normalised", (
        ("covariance.covariance_forward", "rotation_of(unit(quaternion)[0])", "rotation_of(quaternion)"),
    )),
    Convention("quaternions written x, y, z, w", (
        ("covariance.rotation_of", "q[0], q[1:]", "q[3], q[:3]"),
    )),
    Convention("the rotation matrix written w - y^2 and so on, without 2 (half of its products)", (
        ("covariance.rotation_of", "2 * outer + 2 * w * cross", "outer + w * cross"),
    )),
    Convention("a white background, whatever the request asks for", (
        ("compositing.composite_forward", "t * background[:, None, None]", "t * (0 * background + 1)[:, None, None]"),
    )),
    Convention("a black background, whatever the request asks for", (
        ("compositing.composite_forward", "t * background[:, None, None]", "t * (0 * background)[:, None, None]"),
    )),
    Convention("the depth divided by the opacity", (
        ("compositing.composite_forward", "Composite(image, depth,",
         "Composite(image, depth / np.where(opacity == 0, 1, opacity),"),
    )),
    _depth("of the last Gaussian in front of which more than half of the light is left (the median depth)",
           "np.where(layer.taken & (layer.front > 0.5), projected.depth[layer.index], depth)"),
    _depth("of the first Gaussian", "np.where(layer.taken & (opacity == 0), projected.depth[layer.index], depth)"),
    Convention("the depth of the Gaussian of the largest weight, not the sum of weighted depths", (
        (_COMPOSED, "depth = opacity = 0 * t", "depth = opacity = most = 0 * t"),
        (_COMPOSED, _SUMMED, "depth, most = np.where(weight > most, projected.depth[layer.index], depth), "
                             "np.maximum(most, weight)"),
    )),
    Convention("the distance from the camera taken as the depth", (
        (_VISIBLE, "a * c - b * b, z])", "a * c - b * b, np.sqrt(x * x + y * y + z * z)])"),
    )),
    Convention("harmonics of degree 1 without the sign of Condon and Shortley", (
        (_POLYNOMIALS, "(-C1, [(1, 0, 1, 0)])", "(C1, [(1, 0, 1, 0)])"),
        (_POLYNOMIALS, "(-C1, [(1, 1, 0, 0)])", "(C1, [(1, 1, 0, 0)])"),
    )),
    Convention("all harmonics of odd order without the sign of Condon and Shortley", tuple(
        (_POLYNOMIALS, f"(-{old}", f"({old}")
        for old in ("C1, [(1, 0, 1, 0)]", "C1, [(1, 1, 0, 0)]", "C2A, [(1, 0, 1, 1)]", "C2A, [(1, 1, 0, 1)]",
                    "C3A, [(3, 2, 1, 0)", "C3C, [(4, 0, 1, 2)", "C3C, [(4, 1, 0, 2)", "C3A, [(1, 3, 0, 0)")
    )),
    Convention("the direction from the Gaussian to the camera, not from the camera", (
        ("harmonics.directions", "position - centre[:, None]", "centre[:, None] - position"),
    )),
    # the reverse pass of compositing
    Convention("the gradient passing through the clamp of alpha", ((_REVERSE, _PASSES, "taken"),)),
    Convention("the gradient of alpha, not of the value before its clamp, passing through the clamp", (
        (_REVERSE, _PASSES, "taken"), (_REVERSE, _POWER, "alpha * front * (own - rest)"),
    )),
    Convention("what is behind a Gaussian including the Gaussian itself, in the reverse pass", (
        (_REVERSE, _POWER, "value * front * (own - (alpha * own + (1 - alpha) * rest))"),
    )),
    Convention("the transmittance behind the Gaussian taken for that in front of it, in the reverse pass", (
        (_REVERSE, _POWER, "value * front * (1 - alpha) * (own - rest)"),
    )),
    Convention("what is behind a Gaussian not divided by 1 - alpha, in the reverse pass", (
        (_REVERSE, _POWER, "value * front * (own - (1 - alpha) * rest)"),
    )),
    Convention("what is behind a Gaussian not dimmed by it, in the reverse pass", (
        (_REVERSE, "(1 - alpha) * rest, rest)", "rest, rest)"),
    )),
    Convention("what a Gaussian hides left out of the gradient by its alpha", (
        (_REVERSE, "(own - rest)", "own"),
    )),
    Convention("the layers from front to back, not from back to front, in the reverse pass", (
        (_REVERSE, "in reversed(layers)", "in layers"),
    )),
    Convention("the gradient of the opacity image left out of the gradient by alpha", (
        (_REVERSE, "projected.depth[i] * d_depth + d_opacity", "projected.depth[i] * d_depth"),
    )),
    Convention("the gradient of the depth image left out of the gradient by alpha", (
        (_REVERSE, "+ projected.depth[i] * d_depth + d_opacity", "+ d_opacity"),
    )),
    Convention("the background left out of the gradient by alpha", (
        (_REVERSE, "rest = (background[:, None, None] * d_colour).sum(axis=0)",
         "rest = 0 * d_depth"),
    )),
    Convention("gradients of Gaussians behind the stop of the light too, in the reverse pass", (
        (_REVERSE, _PASSES, "~(value > settings.alpha_max)"),
    )),
)  # fmt: skip
