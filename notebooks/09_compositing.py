# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # 9. Compositing, and its reverse pass line by line
#
# At each pixel the Gaussians are ordered by depth. From front to back, each absorbs a fraction of the light that
# remains. This chapter derives this blend, which is called *compositing*, and its reverse pass.
#
# | Symbol | Meaning |
# |---|---|
# | $(u,v)$, $z$ | centre of a Gaussian on the screen, in px, and its depth ({doc}`07_projection`) |
# | $a,b,c$ | its covariance on the screen, $\begin{pmatrix}a&b\\b&c\end{pmatrix}$, in px²; $\det=ac-b^2$ |
# | $d_x,d_y$ | position of the pixel centre minus $(u,v)$ |
# | $m=b/c$, $r=1/c$, $A=c/\det$ | numbers of the ellipse that the code stores |
# | $o$, $\mathrm{logit}$ | opacity, $o=1/(1+e^{-\mathrm{logit}})$, and the stored number |
# | $\alpha$ | opacity at the pixel, clamped to $\alpha_{\max}$ |
# | $\alpha_{\mathrm{cut}}$, $T_{\mathrm{stop}}$ | cutoff of $\alpha$, and the transmittance below which a pixel ends |
# | $T_k$ | transmittance: the fraction of the light that passes all Gaussians in front of Gaussian $k$ |
# | $rgb_k$, $\mathbf{bg}$ | colour of Gaussian $k$ ({doc}`08_harmonics`), and of the background |
# | $\hat I,\hat D,\hat O$ | composited colour, depth and opacity of the pixel |
#
# The equations are {eq}`eq-b5`, {eq}`eq-b5b` and {eq}`eq-b5c` of {doc}`/specification/b05_compositing`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np
from running_clip import load

from endotsr.definition import compositing as definition
from endotsr.method.splatting.binning import depth_order, screen_boxes, tile_lists
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.compositing import (
    TILE_HEIGHT,
    TILE_WIDTH,
    background_gradient,
    composite_forward,
    composite_reverse,
)
from endotsr.method.splatting.projection import Projected
from endotsr.method.splatting.records import gather_gradients, log_opacity, pack_records
from endotsr.method.splatting.render import Scene, render_forward
from endotsr.method.splatting.settings import EXACT, LEGACY, PAPER
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Set-up of the examples", "code_prompt_hide": "Hide the set-up"}
rng = np.random.default_rng(8)
WIDTH, HEIGHT, N = 18, 14, 5
a, c = rng.uniform(8, 60, N), rng.uniform(8, 60, N)
scene = {
    "mean2d": np.stack([rng.uniform(3, 15, N), rng.uniform(3, 11, N)]),
    "covariance2d": np.stack([a, rng.uniform(-0.6, 0.6, N) * np.sqrt(a * c), c]),
    # The third is opaque enough to meet the clamp.
    "logit": np.array([0.3, -1.0, 7.0, 1.5, -0.5]),
    "colour": rng.uniform(0.1, 1, (3, N)),
    "depth": np.array([4.0, 3.0, 6.0, 5.0, 3.5]),  # not in the order of the index
}
background = np.array([0.1, 0.2, 0.3])


def composite(scene, settings, width=WIDTH, height=HEIGHT, background=background):
    """The stages of the package between projection and image."""
    projected = on_screen(scene)
    log_o = log_opacity(scene["logit"])
    box, visible = screen_boxes(projected, log_o, settings, width, height)
    order = depth_order(scene["depth"], visible)
    records = pack_records(order, projected, log_o, scene["colour"])
    lists = tile_lists(box, order, TILE_WIDTH, TILE_HEIGHT, width, height)
    out, saved = composite_forward(records, lists, settings, background, width, height)
    return out, (order, projected, saved, settings)


# %% [markdown]
# ## Forward: the footprint
#
# A Gaussian has an opacity at each pixel, which is largest at its screen centre and falls off with the ellipse of its
# covariance. It is at most $\alpha_{\max}$:
#
# $$
# \begin{aligned}
# \eta&=d_x-m\,d_y,\\
# q&=r\,d_y^2+A\,\eta^2=\frac{d_y^2}{c}+\frac{c}{\det}\Bigl(d_x-\frac bc\,d_y\Bigr)^2,\\
# \alpha&=\min\bigl(\alpha_{\max},\ o\,e^{-q/2}\bigr).
# \end{aligned}
# $$
#
# Here $q$ is the squared Mahalanobis distance: the squared distance of the pixel from the centre, in units of the
# standard deviations of the ellipse. The formula writes it as a sum of two squares. Such a sum is never negative, and
# it is accurate even for needles ({doc}`15_hard_cases`).
#
# ## Forward: the blend
#
# Let the contributors of a pixel be numbered $0,1,\dots,n-1$ from front to back. Their blend is:
#
# $$
# \begin{aligned}
# T_0&=1,\qquad T_{k+1}=T_k(1-\alpha_k),\\
# \hat I&=\sum_{k<n}\alpha_kT_k\,rgb_k+T_n\,\mathbf{bg},\\
# \hat D&=\sum_{k<n}\alpha_kT_k\,z_k,\qquad
# \hat O=\sum_{k<n}\alpha_kT_k .
# \end{aligned}
# $$
#
# Gaussians of equal depth are blended in the order of their indices. A Gaussian with $\alpha<\alpha_{\mathrm{cut}}$ is
# no contributor. If $T_k(1-\alpha_k)<T_{\mathrm{stop}}$, the blend ends before Gaussian $k$. The preset `paper` has
# $\alpha_{\max}=0.99$, $\alpha_{\mathrm{cut}}=1/255$ and $T_{\mathrm{stop}}=10^{-4}$; `exact` has 1, 0 and 0.
#
# The function `reach` of the definition marks the columns and the rows of a box around the support of a Gaussian. In
# `paper`, $o\,e^{-q/2}\ge\alpha_{\mathrm{cut}}$ means $q\le\varrho^2$ with $\varrho^2=2\ln(o/\alpha_{\mathrm{cut}})$. The box
# of this ellipse has the half sides $\varrho\sqrt a$ and $\varrho\sqrt c$, and a margin that is larger than rounding.
# Outside this box $\alpha$ is below the cutoff. The box saves time and changes no pixel.
#
# <!-- definition: endotsr.definition.compositing.opacity_of -->
# ```python
# def opacity_of(logit):
#     """1 / (1 + exp(-logit)), complex allowed, without overflow."""
#     e = np.exp(np.where(logit.real < 0, logit, -logit))
#     return np.where(logit.real < 0, e, 1) / (1 + e)
# ```
#
# <!-- definition: endotsr.definition.compositing.layers_of -->
# ```python
# def layers_of(projected, opacity_logit, settings, width, height):
#     """The layers, front to back (equal depths by index), and the transmittance (H, W) behind all of them."""
#     u, v = projected.mean2d
#     a, b, c = projected.covariance2d
#     opacity = opacity_of(opacity_logit)
#     columns, rows = (reach(projected, opacity_logit, settings, n, axis) for axis, n in enumerate((width, height)))
#     x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
#     t, live = np.ones((height, width)), np.ones((height, width), bool)
#     layers = []
#     for i in np.argsort(projected.depth.real, kind="stable"):  # ruling "order"
#         box = np.outer(rows[:, i], columns[:, i])
#         if not box.any():
#             continue
#         dx, dy = x - u[i], y - v[i]
#         q = (c[i] * dx * dx - 2 * b[i] * dx * dy + a[i] * dy * dy) / projected.determinant[i]
#         value = opacity[i] * np.exp(-q / 2)
#         alpha = np.where(value.real > settings.alpha_max, settings.alpha_max, value)  # ruling "alpha clamp"
#         wanted = live & box & ~(alpha.real < settings.alpha_cutoff)  # NaN is seen
#         live = live & ~(wanted & ((t * (1 - alpha)).real < settings.transmittance_stop))
#         layers.append(Layer(i, dx, dy, value, alpha, t, wanted & live))
#         t = np.where(wanted & live, t * (1 - alpha), t)
#     return layers, t
# ```
#
# <!-- definition: endotsr.definition.compositing.composite_forward -->
# ```python
# def composite_forward(projected, opacity_logit, colour, settings, background, width, height):
#     """Equation (B5): Composite of Gaussians on the screen; colour (3, N), background (3,), logits (N,).
#
#     The kernels divide the image into tiles. They write q as a sum of squares, which stays accurate for needles. A
#     colour that is not finite reaches all pixels here, and in the kernels those near its Gaussian.
#     """
#     layers, t = layers_of(projected, opacity_logit, settings, width, height)
#     image = t * background[:, None, None]
#     depth = opacity = 0 * t
#     for layer in layers:
#         weight = np.where(layer.taken, layer.alpha * layer.front, 0)
#         image = image + weight * colour[:, layer.index, None, None]
#         depth = depth + weight * projected.depth[layer.index]
#         opacity = opacity + weight
#     saved = CompositeSaved(projected, opacity_logit, colour, settings, background, layers, t)
#     return Composite(image, depth, opacity, t), saved
# ```


# %%
def on_screen(scene):
    """What the projection gives to the compositing."""
    a, b, c = scene["covariance2d"]
    return Projected(
        scene["mean2d"],
        scene["covariance2d"],
        a * c - b * b,
        scene["depth"],
        np.ones(a.size, bool),
    )


def by_definition(scene, settings):
    """(images, saved) of the definition."""
    arguments = on_screen(scene), scene["logit"], scene["colour"], settings, background
    return definition.composite_forward(*arguments, WIDTH, HEIGHT)


def contributors_of(column, row, scene, settings):
    """Contributors of one pixel, front to back: (index, alpha, T), and the final T."""
    saved = by_definition(scene, settings)[1]
    at = row, column
    taken = [layer for layer in saved.layers if layer.taken[at]]
    return [(k.index, k.alpha[at], k.front[at]) for k in taken], saved.transmittance[at]


# %%
for preset, numbers in ((PAPER, (0.99, 1 / 255, 1e-4)), (EXACT, (1, 0, 0))):
    assert (preset.alpha_max, preset.alpha_cutoff, preset.transmittance_stop) == numbers
opaque = scene | {"logit": np.full(N, 7.0)}  # so opaque that some pixels end early
endless = PAPER._replace(transmittance_stop=0.0)
assert any(
    len(contributors_of(x, y, opaque, PAPER)[0])
    < len(contributors_of(x, y, opaque, endless)[0])
    for x in range(5, 12)
    for y in range(5, 9)
)
for settings, some in ((PAPER, scene), (PAPER, opaque), (EXACT, scene)):
    out, _ = composite(some, settings)
    for found, text in zip(out, by_definition(some, settings)[0]):
        np.testing.assert_allclose(found, text, rtol=1e-11, atol=1e-13)

# %% [markdown]
# ## Figure: one ray, and the support of a splat under each preset
#
# The left panel shows the contributors of one pixel. The height of a bar is the remaining light $T_k$, and the filled
# part is the fraction $\alpha_kT_k$ that the Gaussian absorbs. The other panels show one Gaussian under the three
# presets. The support of `exact` is the whole image. The support of `paper` ends on the ellipse at which $\alpha$ has
# fallen to 1/255. The preset `legacy` uses the tiles within three standard deviations. Here this removes a few pixels
# of the ellipse at the bottom, too faint to be seen; the line below the figure counts them.

# %% tags=["hide-input"]
figure, axes = plt.subplots(
    1, 4, figsize=(10.9, 3.1), layout="constrained", width_ratios=[1.3, 1, 1, 1]
)
contributors, T_n = contributors_of(9, 7, scene, PAPER)
for k, (i, alpha, T) in enumerate(contributors):
    axes[0].bar(k, T, color="0.9", edgecolor="0.6")
    axes[0].bar(k, alpha * T, color=scene["colour"][:, i], edgecolor="k", lw=0.5)
    axes[0].text(k, alpha * T + 0.02, f"$\\alpha$={alpha:.2f}", ha="center", fontsize=9)
axes[0].bar(len(contributors), T_n, color=background, edgecolor="k", lw=0.5)
axes[0].set(
    title="pixel (9, 7): $T_k$, and the fraction $\\alpha_kT_k$",
    xticks=range(len(contributors) + 1),
)
axes[0].set_xticklabels(
    [f"#{i}\nz={scene['depth'][i]:g}" for i, _, _ in contributors] + ["back"]
)
camera = Camera(np.eye(3), np.zeros(3), 60.0, 60.0, 37.5, 26.5, 72, 56)
splat = Scene(
    np.array([[0.0], [0.0], [1.0]]),
    np.array([[0.9], [0.0], [0.0], [-0.3]]),
    np.log([[0.117], [0.108], [0.1]]),
    np.array([3.0]),
    np.zeros((1, 3, 1)),
)
reached = {}
for panel, (name, settings) in zip(
    axes[1:], (("exact", EXACT), ("paper", PAPER), ("legacy", LEGACY))
):
    opacity = render_forward(splat, camera, settings, degree=0, compositor="definition")[
        0
    ].opacity
    reached[name] = opacity
    shown = panel.imshow(
        np.where(opacity > 0, np.log10(np.maximum(opacity, 1e-12)), np.nan),
        vmin=-6,
        vmax=0,
        cmap="magma",
    )
    panel.contour(reached["exact"], levels=[1 / 255], colors="tab:green", linewidths=1)
    panel.set(title=f"{name}: {np.count_nonzero(opacity)} pixels", xticks=[], yticks=[])
figure.colorbar(shown, ax=axes[1:], label="$\\log_{10}\\alpha$; green line 1/255", shrink=0.8)
assert np.array_equal(reached["paper"] > 0, np.minimum(reached["exact"], 0.99) >= 1 / 255), (
    "the ellipse loses nothing"
)
assert np.count_nonzero(reached["exact"]) == 72 * 56
plt.show()
removed = (reached["paper"] > 0) & (reached["legacy"] == 0)
largest = reached["paper"][removed].max()
print(f"legacy removes {removed.sum()} pixels of the ellipse, alpha at most {largest:.4f}")
assert 0 < removed.sum() < 20 and 1 / 255 <= largest < 2 / 255
assert np.nonzero(removed)[0].min() == np.nonzero(reached["paper"])[0].max(), "at the bottom"

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_{\hat I},g_{\hat D},g_{\hat O}$ are given at each pixel, and we need the gradients with respect to the
# opacity $\alpha_k$, the colour and the depth of each contributor.
#
# **(9.1) The colour behind.** Let $R_k$ be the colour of the pixel without the Gaussians $0,\dots,k-1$, so that
# $\hat I=R_0$. Gaussian $k$ covers the fraction $\alpha_k$ of the colour behind it, which gives the recursion
# $R_k=\alpha_k\,rgb_k+(1-\alpha_k)R_{k+1}$ with the end $R_n=\mathbf{bg}$.
#
# **(9.2) The weight of $R_k$ in the pixel.** Unrolling (9.1) from the front gives
# $\hat I=\sum_{l<k}\alpha_lT_l\,rgb_l+T_kR_k$, and therefore $\partial\hat I/\partial R_k=T_k$. A change of the colour
# behind is weighted by the transmittance in front.
#
# **(9.3) One opacity.** The transmittance $T_k$ depends only on the opacities in front of Gaussian $k$, and $R_{k+1}$
# only on those behind it. Neither depends on $\alpha_k$, so
# $\partial\hat I/\partial\alpha_k=T_k\,\partial R_k/\partial\alpha_k=T_k\,(rgb_k-R_{k+1})$. More opacity adds colour
# of Gaussian $k$ and removes colour behind it.
#
# **(9.4) Depth and opacity** are sums of the same form, with $z_k$ or $1$ instead of the colour and 0 as the
# background. $Z_k$ and $Q_k$ denote the counterparts of $R_k$ in these sums.
#
# **(9.5) The colour and the depth of a Gaussian** enter these sums linearly, with the weight $\alpha_kT_k$.
#
# Together these steps give the reverse pass of the blend. It contains no division by $1-\alpha_k$, so $\alpha_k=1$ is
# not a special case:
#
# $$
# \begin{aligned}
# R_n&=\mathbf{bg},\quad Z_n=0,\quad Q_n=0,\\
# R_k&=\alpha_k\,rgb_k+(1-\alpha_k)R_{k+1},\\
# Z_k&=\alpha_kz_k+(1-\alpha_k)Z_{k+1},\qquad Q_k=\alpha_k+(1-\alpha_k)Q_{k+1},\\
# g_{\alpha_k}&=T_k\bigl[(rgb_k-R_{k+1})\cdot g_{\hat I}+(z_k-Z_{k+1})\,g_{\hat D}+(1-Q_{k+1})\,g_{\hat O}\bigr],\\
# g_{rgb_k}&\mathrel{+}=\alpha_kT_k\,g_{\hat I},\qquad g_{z_k}^{\mathrm{img}}\mathrel{+}=\alpha_kT_k\,g_{\hat D},\\
# g_{\mathbf{bg}}&\mathrel{+}=T_n\,g_{\hat I} .
# \end{aligned}
# $$
#
# **(9.6) From $\alpha$ to the footprint.** Where $\alpha$ is clamped to $\alpha_{\max}$, all gradients below are 0.
# Elsewhere $\alpha=o\,e^{-q/2}$, so $\mathrm d\alpha=\alpha\,\mathrm d\ln o-\tfrac12\alpha\,\mathrm dq$. The
# derivative of the sigmoid gives $\mathrm d\ln o=(1-o)\,\mathrm d\,\mathrm{logit}$.
#
# **(9.7) Through $q$.** A shift of the centre by $(\mathrm du,\mathrm dv)$ changes the distances by
# $\mathrm d d_x=-\mathrm du$ and $\mathrm d d_y=-\mathrm dv$. Differentiating $q=r\,d_y^2+A\,\eta^2$ with
# $\eta=d_x-m\,d_y$ gives the other lines:
#
# $$
# \begin{aligned}
# g_{\mathrm{logit}}&\mathrel{+}=\alpha\,(1-o)\,g_\alpha,\qquad g_q=-\tfrac12\,\alpha\,g_\alpha,\\
# g_A&\mathrel{+}=\eta^2g_q,\qquad g_m\mathrel{+}=-2A\,\eta\,d_y\,g_q,\qquad g_r\mathrel{+}=d_y^2\,g_q,\\
# g_u&\mathrel{+}=-2A\,\eta\,g_q,\qquad g_v\mathrel{+}=-2\,(r\,d_y-A\,m\,\eta)\,g_q .
# \end{aligned}
# $$
#
# **(9.8) Once per Gaussian**, after the sum over the pixels, the gradients of $m=b/c$, $r=1/c$ and $A=c/(ac-b^2)$
# become those of $a,b,c$. The partial derivatives are $\partial A/\partial a=-A^2$, $\partial A/\partial b=2A^2m$,
# $\partial A/\partial c=-A^2m^2$; $\partial m/\partial b=r$, $\partial m/\partial c=-mr$;
# $\partial r/\partial c=-r^2$.
#
# $$
# g_a=-A^2g_A,\qquad g_b=2A^2m\,g_A+r\,g_m,\qquad g_c=-A^2m^2g_A-m\,r\,g_m-r^2g_r .
# $$
#
# Instead of (9.8) the definition differentiates $q$ with respect to the covariance $\Sigma$ on the screen in one step.
# With $d=(d_x,d_y)^{\mathsf T}$ it uses
# $\partial(-q/2)/\partial\Sigma=\tfrac12\Sigma^{-1}dd^{\mathsf T}\Sigma^{-1}$. The sums are the same.
#
# <!-- definition: endotsr.definition.compositing.composite_reverse -->
# ```python
# def composite_reverse(d_colour, d_depth, d_opacity, saved):
#     """Reverse of (B5) from images: the recursion R_k, back to front, then d(-q/2)/dSigma, Sigma on the screen."""
#     projected, logit, colour, settings, background, layers, t = saved
#     out = CompositeGrads._make(np.zeros((*n, logit.size), t.dtype) for n in ((2,), (3,), (), (3,), (), ()))
#     rest = (background[:, None, None] * d_colour).sum(axis=0)  # <g, R>: colour, depth and opacity behind the layer
#     for i, dx, dy, value, alpha, front, taken in reversed(layers):
#         own = np.einsum("c,chw->hw", colour[:, i], d_colour) + projected.depth[i] * d_depth + d_opacity
#         passes = taken & ~(value > settings.alpha_max)  # ruling "alpha clamp": gradient 0 where it is active
#         power = np.where(passes, value * front * (own - rest), 0)  # by -q/2; (9.3), (9.6)
#         (a, b, c), det = projected.covariance2d[:, i], projected.determinant[i]
#         px, py = (c * dx - b * dy) / det, (a * dy - b * dx) / det  # Sigma^-1 d; (9.7)
#         out.d_mean2d[:, i] = (power * px).sum(), (power * py).sum()
#         out.d_covariance2d[:, i] = np.array([power * px**2 / 2, power * px * py, power * py**2 / 2]).sum((1, 2))
#         out.d_opacity_logit[i] = power.sum() * opacity_of(-logit[i])
#         weight = np.where(taken, alpha * front, 0)
#         out.d_colour[:, i], out.d_depth[i] = (weight * d_colour).sum((1, 2)), (weight * d_depth).sum()  # (9.5)
#         rest = np.where(taken, alpha * own + (1 - alpha) * rest, rest)  # (9.1)
#     return out._replace(d_background=(d_colour * t).sum((1, 2)))
# ```

# %%
g_I, g_D, g_O = (
    rng.normal(size=(3, HEIGHT, WIDTH)),
    rng.normal(size=(HEIGHT, WIDTH)),
    rng.normal(size=(HEIGHT, WIDTH)),
)


def kernel_reverse(scene, settings, g_I, g_D, g_O, conic_epsilon=0.0, **size):
    out, (order, projected, saved, _) = composite(scene, settings, **size)
    pairs = composite_reverse(g_I, g_D, g_O, saved)
    grads = gather_gradients(
        order,
        saved.records,
        saved.lists,
        pairs,
        projected.determinant,
        scene["logit"],
        conic_epsilon=conic_epsilon,
        keep_depth=True,
    )
    names = ("mean2d", "covariance2d", "logit", "colour", "depth")
    return dict(zip(names, grads)) | {"background": background_gradient(g_I, out.transmittance)}


for settings in (PAPER, EXACT):
    found = kernel_reverse(scene, settings, g_I, g_D, g_O)
    grads = definition.composite_reverse(g_I, g_D, g_O, by_definition(scene, settings)[1])
    for name, text in grads._asdict().items():
        name = name.removeprefix("d_").removeprefix("opacity_")
        np.testing.assert_allclose(found[name], text, rtol=1e-9, atol=1e-11, err_msg=name)

# %% [markdown]
# ## Figure: a pixel of the running clip
#
# The examples above have five Gaussians. The running clip of this book is a simulated clip of 63 frames of 640x512,
# and the scene below was trained on it ({doc}`14_full_sequence`). The frame shown is held out, which means that it was
# not used in training. At the marked pixel the model is wrong: a highlight is narrower in the render than in the
# frame. The bars show the terms of the blend, which come from many faint Gaussians, most of them behind others. The
# right panel shows $g_{\alpha_k}$ of (9.3) for the loss $\frac12\|\hat I-I\|^2$. Where this gradient is negative, more
# opacity lowers the loss. Which contributors should have a negative gradient, the white or the red ones?

# %% tags=["hide-input"]
clip = load()
column, row = clip.pixel
out, saved = render_forward(clip.scene, clip.camera, PAPER, degree=0)
u, v = saved.projected.mean2d
a, b, c = saved.projected.covariance2d.astype(np.float64)
dx, dy = column + 0.5 - u, row + 0.5 - v
q = dy**2 / c + c / (a * c - b * b) * (dx - b / c * dy) ** 2
alphas = np.minimum(
    PAPER.alpha_max, definition.opacity_of(clip.scene.opacity_logit) * np.exp(-q / 2)
)
colours = 0.5 + 0.5 / np.sqrt(np.pi) * clip.scene.harmonics[0]
terms, T = [], 1.0
for k in np.flatnonzero(alphas >= PAPER.alpha_cutoff):  # the scene is stored front to back
    if T * (1 - alphas[k]) < PAPER.transmittance_stop:
        break
    terms.append((alphas[k], T, colours[:, k]))
    T *= 1 - alphas[k]
g_pixel = (
    sum(alpha * front * colour for alpha, front, colour in terms) - clip.image[:, row, column]
)
pulls, behind, R = [], [], np.zeros(3)  # (9.1), (9.3): back to front
for alpha, front, colour in reversed(terms):
    pulls.append(front * (colour - R) @ g_pixel)
    behind.append(R)
    R = alpha * colour + (1 - alpha) * R
np.testing.assert_allclose(R, out.colour[:, row, column], atol=1e-4)

figure, axes = plt.subplots(
    1, 4, figsize=(10.9, 3.1), layout="constrained", width_ratios=[1, 1, 1.5, 1.5]
)
near = slice(row - 32, row + 32), slice(column - 32, column + 32)
for panel, picture, title in ((axes[0], clip.image, "frame"), (axes[1], out.colour, "render")):
    panel.imshow(np.clip(picture, 0, 1).transpose(1, 2, 0)[near])
    panel.plot(32, 32, "o", mec="k", mfc="none", ms=9)
    panel.set(title=title, xticks=[], yticks=[])
for k, (alpha, front, colour) in enumerate(terms):
    axes[2].bar(k, front, width=1, color="0.9")
    axes[2].bar(k, alpha * front, width=1, color=np.clip(colour, 0, 1), edgecolor="k", lw=0.3)
axes[2].set(title="$T_k$, and the fraction $\\alpha_kT_k$", xlabel="contributor, front to back")
axes[3].bar(range(len(pulls)), pulls[::-1], width=1, color="#0072B2")
axes[3].axhline(0, color="k", lw=0.8)
axes[3].set(title="$g_{\\alpha_k}$", xlabel="contributor, front to back")
plt.show()
wanted, rest = np.array(pulls[::-1][:20]), behind[::-1]  # of the contributors with some weight
white = np.array([colour[1:].sum() for _, _, colour in terms[:20]])  # green and blue
brighter = np.array([(colour > R)[1:].all() for (_, _, colour), R in zip(terms[:20], rest)])
assert g_pixel[1:].max() < -0.1 and (wanted[brighter] < 0).all() and 0 < brighter.sum() < 20
assert abs(g_pixel[0]) < 1 / 255, "its red is right"
(odd,) = np.flatnonzero((white > np.median(white)) & (wanted > 0))  # it hides something whiter
assert (rest[odd] > terms[odd][2])[1:].all()
half = np.searchsorted(np.cumsum([alpha * front for alpha, front, _ in terms]), 0.5) + 1
print(f"{len(terms)} contributors; the first {half} have half of the weight; T_n = {T:.4f}")
print(f"error of the pixel: {np.abs(g_pixel).max() * 255:.0f} of 255")

# %% [markdown]
# At this pixel the render has too little green and blue, and its red is right. The gradient is therefore negative for a
# Gaussian that has more of both than $R_{k+1}$, the colour **behind** it. Step (9.3) compares a Gaussian with what it hides, not with
# the frame. One of the whiter half of the first 20 contributors has a positive gradient, because it hides
# something still whiter. The gradients are small where $T_k$ is small: a Gaussian at the back changes the picture little while those
# in front of it are opaque.

# %% [markdown]
# ## A deviation of `diff-gaussian-rasterization`
#
# The released rasteriser of 3DGS (`diff-gaussian-rasterization`) adds a small number to $\det^2$ in step (9.8), which
# multiplies its $g_a,g_b,g_c$ by $\det^2/(\det^2+10^{-7})$. The preset `legacy` reproduces this under the name
# `conic_epsilon`. The next cell uses a larger number, to make the effect visible.

# %%
exact, damped = (
    kernel_reverse(scene, PAPER, g_I, g_D, g_O, conic_epsilon=number) for number in (0.0, 1e4)
)
det = scene["covariance2d"][0] * scene["covariance2d"][2] - scene["covariance2d"][1] ** 2
np.testing.assert_allclose(
    damped["covariance2d"], exact["covariance2d"] * det**2 / (det**2 + 1e4), rtol=1e-12
)

# %% [markdown]
# ## Interactive figure: three opacities
#
# The grey box is the light that reaches a Gaussian, and the coloured part is the light that it absorbs. The loss is
# half the squared distance to the target colour. Before you drag a handle, suppose that the second opacity becomes 1.
# Which gradients become 0, that of the first, of the second or of the third opacity? Derive the answer from (9.3),
# then try.
#
# <div class="widget" data-widget="compositing">The figure is live in the built book.</div>

# %% [markdown]
# ## The gradient check
#
# A finite difference is taken only between two points at which the discrete decisions (order, contributors, clamp) are
# the same. The pair `composite_blocks` is the fast path of training. Its reverse pass runs front to back and divides by
# $1-\alpha_k$, which the clamp of `paper` keeps at 0.01 or above. It computes the same gradients to rounding.

# %%
with one_thread():
    reports = [
        check_pair(all_pairs()[name], pair_stream(name, 0))
        for name in ("composite_exact", "composite_paper", "composite_blocks")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. A pixel has two contributors, both with $\alpha=\frac12$ and the same colour $rgb$. Use (9.3) to show that both
#    opacities have the same gradient, and that it is 0 where $rgb$ equals the background.
# 2. Write the pair of {eq}`eq-b5` from (9.1) to (9.8) and let the golden cases judge it: `--only composite`
#    ({doc}`index`). A port that divides by $1-\alpha$ fails the case `opaque_exact`.
# 3. The cell below answers this one. At one pixel there are three Gaussians with $\alpha=0.3,\ 1,\ 0.5$, front to
#    back. Which of the three opacities and of the three colours have a gradient? Many programs recover $T_k$ in the
#    reverse pass by dividing the final $T_n$ by $1-\alpha$. What would such a program compute here?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The first two have gradients, the opaque one included (less opacity would show the
# third). The third has none. Division starts from T_n = 0: 0 / (1 - 0.5) = 0, then 0 / (1 -
# 1) = nan, and everything in front is lost.
wide = 1e12  # px^2: the pixel sees the centre
one = {
    "mean2d": np.full((2, 3), 0.5),
    "covariance2d": np.array([[wide] * 3, [0.0] * 3, [wide] * 3]),
    "logit": np.array([np.log(0.3 / 0.7), 700.0, 0.0]),
    "colour": np.eye(3),
    "depth": np.array([1.0, 2.0, 3.0]),
}
white = np.ones((3, 1, 1)) * np.array([1.0, 2.0, 4.0])[:, None, None]
zero = np.zeros((1, 1))
grads = kernel_reverse(one, EXACT, white, zero, zero, width=1, height=1)
np.testing.assert_allclose(grads["colour"].sum(axis=0), np.array([0.3, 0.7, 0.0]) * 7)
# A logit of 700 is flat: (1 - o) = 0.
np.testing.assert_allclose(grads["logit"], [0.3 * 0.7 * (1 - 2), 0, 0], atol=1e-14)
# The gradient of the opacity itself is g_logit / (o (1 - o)). Here o is just below 1.
o = 1 / (1 + np.exp(-16.0))
almost = one | {"logit": np.array([np.log(0.3 / 0.7), 16.0, 0.0])}
g_logit = kernel_reverse(almost, EXACT, white, zero, zero, width=1, height=1)["logit"]
behind = 0.5 * 4 + 0.5 * background @ [1, 2, 4]  # of the third and the background
np.testing.assert_allclose(g_logit[1] / (o * (1 - o)), 0.7 * (2 - behind), rtol=1e-5)
with np.errstate(invalid="ignore"):
    T_2 = np.float64(0.0) / (1 - 0.5)
    assert np.isnan(T_2 / np.float64(1 - 1.0))
