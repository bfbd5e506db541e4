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
# # 10. The mask-propagating Laplacian pyramid (component L)
#
# In a mean over pixels, a blurred vessel counts no more than a wall that is slightly too dark. Component L therefore
# compares fine detail separately, in the bands of a pyramid. The difficulty is the instrument, whose pixels are
# excluded: a filter that reads one of these pixels gives a wrong value beside the instrument. Component L counts a
# band value only if **no excluded pixel has any weight in it**.
#
# | Symbol | Meaning |
# |---|---|
# | $\hat I$, $I$ | render and frame, (3, H, W), in display units (0 is black, 1 is white); both are set to 0 at excluded pixels |
# | $\mathsf D$, $\mathsf U$ | down-sampling to half the size, up-sampling to twice the size |
# | $G_j$ | the image after $j$ down-samplings; $G_0$ is the image itself |
# | $P_j$ | band $j$: what $G_{j-1}$ loses when it is down-sampled and up-sampled again |
# | $S_j$, $V_j$ | samples of $G_j$ without an excluded pixel; valid values of band $j$ |
# | $n_j$, $n_c$ | number of valid values of band $j$; number of samples of the coarse image along the axis |
# | $\mathrm{refl}(k,n)$ | index $k$ reflected into $0,\dots,n-1$: $-1\mapsto1$, $n\mapsto n-2$ |
#
# The equation is {eq}`eq-5` of {doc}`/specification/05_laplacian`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.clips.simulator import SimulatorSettings, simulate
from endotsr.definition import laplacian as definition
from endotsr.method.equations.laplacian import (
    laplacian_levels,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    support_masks,
)
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %%
rng = np.random.default_rng(9)

# %% [markdown]
# ## Down and up
#
# Down-sampling $\mathsf D$ filters rows and columns with $b=\tfrac1{16}(1,4,6,4,1)$ and keeps the samples of even
# index:
#
# $$
# (\mathsf D G)[y,x] = \sum_{r=-2}^{2}\sum_{s=-2}^{2} b_r b_s\; G\bigl[\mathrm{refl}(2y+r,H),\ \mathrm{refl}(2x+s,W)\bigr],
# $$
#
# with the image reflected at its border, without repeating the edge sample.
#
# Up-sampling $\mathsf U$ is linear interpolation along each axis, by one of two rules. The preset `paper` uses `co_sited`:
#
# $$
# \begin{aligned}
# \texttt{co_sited:}\quad & (\mathsf U g)[2k] = g[k],\\
# & (\mathsf U g)[2k+1] = \tfrac12 g[k] + \tfrac12 g[\min(k+1,n_c-1)],\\
# \texttt{half_pixel:}\quad & (\mathsf U g)[2k] = \tfrac14 g[\max(k-1,0)] + \tfrac34 g[k],\\
# & (\mathsf U g)[2k+1] = \tfrac34 g[k] + \tfrac14 g[\min(k+1,n_c-1)] .
# \end{aligned}
# $$
#
# Both rules are linear and act on each axis separately, so each consists of one small matrix per axis. The definition
# forms these matrices; the compiled functions do not.
#
# <!-- definition: endotsr.definition.laplacian.reduce_matrix -->
# ```python
# def reduce_matrix(n):
#     """D along one axis, (ceil(n/2), n): five binomial taps at the even samples, mirrored at the border."""
#     matrix = np.zeros(((n + 1) // 2, n))
#     for row in range(len(matrix)):
#         for tap, weight in zip(range(2 * row - 2, 2 * row + 3), (1, 4, 6, 4, 1)):
#             k = tap % max(2 * (n - 1), 1)
#             matrix[row, k if k < n else 2 * (n - 1) - k] += weight / 16
#     return matrix
# ```
#
# <!-- definition: endotsr.definition.laplacian.expand_matrix -->
# ```python
# def expand_matrix(n, upsampling):
#     """U along one axis, (n, ceil(n/2)): linear interpolation, constant beyond the end samples."""
#     coarse = np.arange((n + 1) // 2)
#     at = np.arange(n) / 2 if upsampling == "co_sited" else (np.arange(n) + 0.5) / 2 - 0.5
#     return np.stack([np.interp(at, coarse, unit) for unit in np.eye(coarse.size)], axis=1)
# ```
#
# <!-- definition: endotsr.definition.laplacian.laplacian_levels -->
# ```python
# def laplacian_levels(image, levels=3, upsampling="co_sited"):
#     """G_j = D G_{j-1}, P_j = G_{j-1} - U G_j of an image (C, H, W)."""
#     bands = []
#     for _ in range(levels):
#         d_rows, u_rows, d_columns, u_columns = matrices(image.shape[1:], upsampling)
#         coarse = d_rows @ image @ d_columns.T
#         bands.append(image - u_rows @ coarse @ u_columns.T)
#         image = coarse
#     return LaplacianLevels(tuple(bands), image)
# ```

# %%
for matrix in (
    definition.reduce_matrix(9),
    definition.expand_matrix(9, "co_sited"),
    definition.expand_matrix(9, "half_pixel"),
):
    np.testing.assert_allclose(matrix.sum(axis=1), 1)  # a constant is unchanged


def up(g, fine, rule):
    rows, columns = (definition.expand_matrix(n, rule) for n in fine.shape[1:])
    return rows @ g @ columns.T


for shape in ((3, 37, 46), (3, 16, 9), (3, 1, 5)):
    image = rng.uniform(size=shape)
    for rule in ("co_sited", "half_pixel"):
        text = definition.laplacian_levels(image, 3, rule)
        found = laplacian_levels(image, 3, rule)
        for expected, band in zip([*text.bands, text.coarse], [*found.bands, found.coarse]):
            np.testing.assert_allclose(band, expected, atol=1e-14)
        P, coarse = text.bands, text.coarse
        rebuilt = P[0] + up(P[1] + up(P[2] + up(coarse, P[2], rule), P[1], rule), P[0], rule)
        np.testing.assert_allclose(rebuilt, image, atol=1e-14)  # nothing is lost

# %% [markdown]
# A ramp of slope 1 distinguishes the two rules. In its interior the three bands are 0 with `co_sited`, and
# $\tfrac12,1,2$ with `half_pixel`.

# %%
ramp = np.broadcast_to(np.arange(96.0), (1, 96, 96)).copy()
for rule, values in (("co_sited", (0, 0, 0)), ("half_pixel", (0.5, 1, 2))):
    for band, value in zip(laplacian_levels(ramp, 3, rule).bands, values):
        middle = band.shape[1] // 2
        np.testing.assert_allclose(np.abs(band[0, middle, middle]), value, atol=1e-12)

# %% [markdown]
# ## Which values are valid
#
# A second pyramid, that of the mask, says which values depend on tissue alone. Its level $S_j$ is the *support* of
# level $j$, and $S_0$ is the mask itself, true on tissue. A coarse sample is supported if all of its $5\times5$ inputs
# are supported. A band value is valid if its own fine sample is supported, and so is every coarse sample that
# $\mathsf U$ reads there:
#
# $$
# \begin{aligned}
# S_j[y,x] &= \bigwedge_{r,s=-2}^{2} S_{j-1}\bigl[\mathrm{refl}(2y+r),\mathrm{refl}(2x+s)\bigr],\\
# V_j(p) &= S_{j-1}(p)\ \wedge\bigwedge_{q:\ \mathsf U_{pq}\ne0} S_j(q) .
# \end{aligned}
# $$
#
# ## The loss
#
# The levels of the render are $G_0=\hat I$ and $G_j=\mathsf D G_{j-1}$, and its bands are $P_j=G_{j-1}-\mathsf U G_j$.
# The bands of the observed image are formed in the same way. With $n_j$ valid values in band $j$, the loss is:
#
# $$
# \begin{aligned}
# \mathcal L_{\mathrm{lap}} &= \frac13\sum_{j=1}^{3}\mathcal L_j,\\
# \mathcal L_j &= \begin{cases}\dfrac{1}{3\,n_j}\displaystyle\sum_{c=1}^{3}\ \sum_{p:\,V_j(p)}\bigl|\,P_j(\hat I)_{c,p} - P_j(I)_{c,p}\bigr| & n_j>0\\[1ex] 0 & n_j=0 .\end{cases}
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.laplacian.support_masks -->
# ```python
# def support_masks(mask, levels=3, upsampling="co_sited"):
#     """V_j: values to which no excluded pixel of `mask` (H, W) contributes. S_0 = mask is propagated through D and U."""
#     bands = []
#     valid = mask
#     for _ in range(levels):
#         d_rows, u_rows, d_columns, u_columns = (matrix != 0 for matrix in matrices(valid.shape, upsampling))
#         coarse = ~(d_rows @ ~valid @ d_columns.T)
#         bands.append(valid & ~(u_rows @ ~coarse @ u_columns.T))
#         valid = coarse
#     return SupportMasks(mask, tuple(bands), upsampling)
# ```
#
# <!-- definition: endotsr.definition.laplacian.laplacian_loss_forward -->
# ```python
# def laplacian_loss_forward(rendered, observed, masks, upsampling="co_sited"):
#     """Equation (5): display units, from two pyramids. The kernel builds one pyramid of the difference.
#
#     `upsampling` is the rule of the masks, by which the reverse pass goes.
#     """
#     images = [np.where(masks.image, image, 0) for image in (rendered, observed)]
#     one, other = (laplacian_levels(image, len(masks.bands), upsampling).bands for image in images)
#     loss, slopes = 0.0, []
#     for p, q, valid in zip(one, other, masks.bands):
#         weight = valid / max(len(p) * valid.sum(), 1) / len(masks.bands)
#         loss += (weight * np.abs(p - q)).sum()
#         slopes.append(weight * np.sign(p - q))  # (10.1)
#     return loss, LaplacianSaved(tuple(slopes), masks)
# ```

# %%
sequence = simulate(SimulatorSettings(width=96, height=72, frames=8)).sequence
frame = sequence.frame(5, np.float64)
observed, mask = frame.image, frame.mask
rendered = observed + rng.normal(0, 0.05, observed.shape)
for rule in ("co_sited", "half_pixel"):
    masks = support_masks(mask, 3, rule)
    text = definition.support_masks(mask, 3, rule)
    assert all(map(np.array_equal, masks.bands, text.bands))
    loss, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    expected, _ = definition.laplacian_loss_forward(rendered, observed, text, rule)
    np.testing.assert_allclose(loss, expected, rtol=1e-12)

# %% [markdown]
# **No value under the instrument is read.** The next cell puts NaN there, in the render and in the observed frame.
# Loss and gradient stay the same:

# %%
masks = support_masks(mask)
loss, saved = laplacian_loss_forward(rendered, observed, masks)
spoiled = [np.where(mask, image, np.nan) for image in (rendered, observed)]
loss_spoiled, saved_spoiled = laplacian_loss_forward(*spoiled, masks)
assert loss_spoiled == loss
assert np.array_equal(
    laplacian_loss_reverse(1.0, saved_spoiled), laplacian_loss_reverse(1.0, saved)
)

# %% [markdown]
# ## Figure: valid masks per level, and the effect of masking first
#
# The upper row shows the valid values of each level. Grey is tissue whose value is not used, because its support
# touches the instrument. The lower row shows the bands of the observed image if the image is multiplied by the mask
# first and filtered afterwards, from 0 (black) to 0.2 (pale yellow). Where do you expect the strongest detail in these
# bands?

# %% tags=["hide-input"]
figure, axes = plt.subplots(2, 4, figsize=(10.1, 4.6), layout="constrained")
axes[0, 0].imshow(observed.transpose(1, 2, 0))
axes[0, 0].set_title("observed frame")
axes[1, 0].imshow(np.where(mask, observed, 0).transpose(1, 2, 0))
axes[1, 0].set_title(f"tissue: {mask.mean():.0%}")
naive = laplacian_levels(np.where(mask, observed, 0.0)).bands
for j, valid in enumerate(masks.bands):
    tissue = mask[:: 2**j, :: 2**j]
    picture = np.where(valid, 1.0, np.where(tissue, 0.6, 0.0))
    axes[0, j + 1].imshow(picture, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    axes[0, j + 1].set_title(
        f"$V_{j + 1}$: {valid.mean():.0%} of {valid.shape[1]}x{valid.shape[0]}"
    )
    axes[1, j + 1].imshow(
        np.abs(naive[j]).mean(axis=0), cmap="magma", vmin=0, vmax=0.2, interpolation="nearest"
    )
    axes[1, j + 1].set_title(f"$|P_{j + 1}|$, masked first")
    false = np.abs(naive[j]).mean(axis=0)
    assert false[~valid].max() > false[valid].max(), (
        "the false edge is stronger than all true detail"
    )
for panel in axes.flat:
    panel.set(xticks=[], yticks=[])
plt.show()

# %% [markdown]
# The strongest detail is the edge of the instrument. A loss that compares the bands of an unmasked render with these bands
# would make the render reproduce it.

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_{\mathcal L}$ is given, and we need the gradient with respect to the render $\hat I$.
#
# **(10.1) The absolute value.** The derivative of $|x|$ is $\operatorname{sign}(x)$. Let $\sigma_j$ be the sign of the
# difference of the bands. The loss is a mean over three levels, three channels and $n_j$ values, so each valid value
# has the weight $1/(9n_j)$.
#
# **(10.2) A linear map.** The remaining operations are linear, and $y=Mx$ gives $g_x=M^\top g_y$. The reverse pass
# therefore applies the transposes of $\mathsf D$ and $\mathsf U$.
#
# **(10.3) One band.** Since $P_j=G_{j-1}-\mathsf UG_j$, the gradient $g_{P_j}$ is added to that of $G_{j-1}$, and
# $-\mathsf U^\top g_{P_j}$ is added to that of $G_j$.
#
# **(10.4) The next level.** Since $G_{j+1}=\mathsf DG_j$, the term $\mathsf D^\top g_{G_{j+1}}$ is added to the gradient of
# $G_j$.
#
# **(10.5) From coarse to fine.** The coarsest level $G_3$ occurs in $P_3$ only, so the reverse pass begins there. The
# gradients of $G_2$ and $G_1$ collect the three parts of (10.3) and (10.4). Finally, $G_0=\hat I$ is the fine image of
# $P_1$ and the source of $G_1$.
#
# **(10.6) Excluded pixels** are set to 0 before the pyramid is built. They are constants of the loss, so their
# gradient is 0.
#
# $$
# \begin{aligned}
# g_{P_j} &= \frac{g_{\mathcal L}}{9\,n_j}\,\sigma_j\ \text{ on } V_j,\ 0 \text{ elsewhere},\\
# g_{G_3} &= -\mathsf U^\top g_{P_3},\\
# g_{G_j} &= g_{P_{j+1}} - \mathsf U^\top g_{P_j} + \mathsf D^\top g_{G_{j+1}}\qquad (j=2,1),\\
# g_{\hat I} &= g_{P_1} + \mathsf D^\top g_{G_1}.
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.laplacian.laplacian_loss_reverse -->
# ```python
# def laplacian_loss_reverse(d_loss, saved):
#     """Reverse of (5): d_rendered (3, H, W); g_{G_{j-1}} = g_{P_j} + D^T (g_{G_j} - U^T g_{P_j}), coarse to fine."""
#     d_coarse = 0.0
#     for slope in reversed(saved.slopes):  # (10.5)
#         d_rows, u_rows, d_columns, u_columns = matrices(slope.shape[1:], saved.masks.upsampling)
#         d_coarse = d_coarse - u_rows.T @ slope @ u_columns  # (10.2), (10.3)
#         d_coarse = slope + d_rows.T @ d_coarse @ d_columns  # (10.3), (10.4)
#     return d_loss * np.where(saved.masks.image, d_coarse, 0)  # (10.6)
# ```

# %%
for rule in ("co_sited", "half_pixel"):
    masks = support_masks(mask, 3, rule)
    _, saved = laplacian_loss_forward(rendered, observed, masks, rule)
    found = laplacian_loss_reverse(0.83, saved)
    _, of_text = definition.laplacian_loss_forward(rendered, observed, masks, rule)
    text = definition.laplacian_loss_reverse(0.83, of_text)
    np.testing.assert_allclose(found, text, rtol=1e-9, atol=1e-16)
    assert not np.any(found[:, ~mask])

# %% [markdown]
# ## Interactive figure: paint an instrument
#
# Paint excluded pixels in the first panel, with the pointer or with the arrow keys and the space bar. The other panels
# show the values of each band that do not depend on an excluded pixel. A single excluded pixel in the middle removes a
# neighbourhood of values, whose width in pixels about doubles from band to band. Before you paint, estimate what
# fraction of band 3 it removes.
#
# <div class="widget" data-widget="masks">The figure is live in the built book.</div>

# %% [markdown]
# ## The gradient check
#
# The check has one pair for each rule of up-sampling.

# %%
with one_thread():
    reports = [
        check_pair(
            all_pairs()[f"laplacian_loss_{rule}"], pair_stream(f"laplacian_loss_{rule}", 0)
        )
        for rule in ("co_sited", "half_pixel")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. A render is brighter than the frame by the same amount everywhere. In which bands do valid values of the two differ?
#    Which other losses show such an error, and which parameters of the model can correct it?
# 2. Write the pair of {eq}`eq-5`, and let the golden cases judge it: `--only laplacian` ({doc}`index`). A pyramid that
#    reads the instrument and multiplies by the mask afterwards fails the case `not_finite_under_mask`.
# 3. The cell below answers this one. A single pixel in the middle of a large image is excluded. How many values of
#    each band become invalid with `co_sited`? Does the number depend on whether the coordinates of the pixel are even
#    or odd?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. On the diagonal, an even pixel is read by more coarse samples of band 1 than an odd
# one: it costs 49 values, an odd one 25. In bands 2 and 3 the parity does not decide: the even
# pixels 64 and 66 cost 49 and 81 values of each. In band 2 the position modulo 4 decides, and
# in band 3 the position modulo 8.
costs = {}
for at in range(64, 81):
    hole = np.ones((161, 161), bool)
    hole[at, at] = False
    costs[at] = [int(np.count_nonzero(~valid)) for valid in support_masks(hole).bands]
    print(f"pixel {at}: {costs[at]}")
assert {at % 2: cost[0] for at, cost in costs.items()} == {0: 49, 1: 25}, "band 1: the parity"
assert costs[64] == [49, 49, 49] and costs[65] == [25, 49, 49] and costs[66] == [49, 81, 81]
for band, period in ((0, 2), (1, 4), (2, 8)):
    course = [cost[band] for cost in costs.values()]
    assert course[period:] == course[:-period], "the period"
    assert course[period // 2 :] != course[: -period // 2], "no shorter one"
