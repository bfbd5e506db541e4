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
# # 10. The base losses: L1, SSIM, depth and smoothness
#
# The base model has four loss terms: the colour of each pixel, the structure of the colours, the depth against the
# prior depth, and smoothness where nothing is observed. The colour terms read no value under the instrument. The depth
# term reads two maxima there, and smoothness the render.
#
# The equations are {eq}`eq-b6` of {doc}`/specification/b06_masked_l1`, {eq}`eq-b7` of
# {doc}`/specification/b07_masked_ssim`, {eq}`eq-b8` of {doc}`/specification/b08_depth` and {eq}`eq-b9` of
# {doc}`/specification/b09_smoothness`.
# The optional exposure of a frame, {eq}`eq-b13` of {doc}`/specification/b13_exposure`, acts on the render before the
# losses do.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import matplotlib.pyplot as plt
import numpy as np

from endotsr.equations.exposure import exposure_forward, exposure_reverse
from endotsr.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.losses.depth import (
    depth_target,
    normalised_depth_forward,
    normalised_depth_reverse,
)
from endotsr.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.losses.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.losses.smoothness import smoothness_forward, smoothness_reverse
from endotsr.opencv import canny_edges
from endotsr.simulator import SimulatorSettings, simulate

# %%
rng = np.random.default_rng(10)
sequence = simulate(SimulatorSettings(width=64, height=48, frames=8)).sequence
frame = sequence.frame(5, np.float64)
I, M, D_prior = frame.image, frame.mask, frame.depth
I_hat = I + rng.normal(0, 0.05, I.shape)
D_hat = np.where(D_prior > 0, D_prior, 40.0) * 1.3 + rng.normal(0, 0.4, M.shape)
H, W = M.shape

# %% [markdown]
# ## Masked L1
#
# $$
# \mathcal L_1=\frac{1}{3n}\sum_{c=1}^{3}\ \sum_{p:\,M_p}\bigl|\hat I_{cp}-I_{cp}\bigr| .
# $$
#
# ## Masked SSIM
#
# Both images are 0 where the mask is False. $k$ is a Gaussian window of 11×11 with standard deviation 1.5 and sum 1.
# $*$ is convolution with zeros outside the image.
#
# $$
# \begin{aligned}
# &\mu_x=k*x,\quad \mu_y=k*y,\\
# &\sigma_x^2=k*x^2-\mu_x^2,\quad \sigma_y^2=k*y^2-\mu_y^2,\quad \sigma_{xy}=k*(xy)-\mu_x\mu_y,\\
# &a_1=2\mu_x\mu_y+C_1,\quad a_2=2\sigma_{xy}+C_2,\\
# &b_1=\mu_x^2+\mu_y^2+C_1,\quad b_2=\sigma_x^2+\sigma_y^2+C_2,\\
# &s=\frac{a_1a_2}{b_1b_2},\qquad \mathcal S=\frac{1}{3n}\sum_{c}\ \sum_{p:\,M_p}s_{cp} .
# \end{aligned}
# $$
#
# The code computes the same quantity from the difference $e=x-y$ and the sum $f=x+y$. This form needs no covariance, is
# exactly 1 for equal images, and keeps all digits of $1-s$:
#
# $$
# \begin{aligned}
# B_1&=\tfrac12(\mu_f^2+\mu_e^2)+C_1,\qquad B_2=\tfrac12(\sigma_f^2+\sigma_e^2)+C_2,\\
# P&=1-\frac{\mu_e^2}{B_1},\qquad Q=1-\frac{\sigma_e^2}{B_2},\\
# s&=PQ,\qquad 1-s=(1-P)+P(1-Q),
# \end{aligned}
# $$


# %% tags=["transcription"]
def l1_text(I_hat, I, M):
    n = M.sum()
    return np.abs(I_hat - I)[:, M].sum() / (3 * n)


kappa = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))
kappa = kappa / kappa.sum()


def window(image):
    """k * image, zeros outside."""
    padded = np.pad(image, ((0, 0), (5, 5), (5, 5)))
    h, w = image.shape[1:]
    return sum(
        kappa[i] * kappa[j] * padded[:, i : i + h, j : j + w]
        for i in range(11)
        for j in range(11)
    )


def ssim_map_text(x, y):
    C_1, C_2 = 1e-4, 9e-4
    mu_x, mu_y = window(x), window(y)
    var_x, var_y = window(x**2) - mu_x**2, window(y**2) - mu_y**2
    cov = window(x * y) - mu_x * mu_y
    a_1, a_2 = 2 * mu_x * mu_y + C_1, 2 * cov + C_2
    b_1, b_2 = mu_x**2 + mu_y**2 + C_1, var_x + var_y + C_2
    return a_1 * a_2 / (b_1 * b_2), (mu_x, mu_y, a_1, a_2, b_1, b_2)


def stable_map_text(x, y):
    C_1, C_2 = 1e-4, 9e-4
    e, f = x - y, x + y
    mu_e, mu_f = window(e), window(f)
    B_1 = (mu_f**2 + mu_e**2) / 2 + C_1
    B_2 = (window(f**2) - mu_f**2 + window(e**2) - mu_e**2) / 2 + C_2
    P, Q = 1 - mu_e**2 / B_1, 1 - (window(e**2) - mu_e**2) / B_2
    return P * Q


# %%
l1, saved_l1 = masked_l1_forward(I_hat, I, M)
np.testing.assert_allclose(l1, l1_text(I_hat, I, M), rtol=1e-13)
x, y = np.where(M, I_hat, 0), np.where(M, I, 0)
s, parts = ssim_map_text(x, y)
np.testing.assert_allclose(stable_map_text(x, y), s, atol=1e-11)
target = ssim_target(I, M)
S, saved_ssim = masked_ssim_forward(I_hat, target)
np.testing.assert_allclose(S, s[:, M].sum() / (3 * M.sum()), rtol=1e-11)
assert masked_ssim_forward(I, target)[0] == 1.0

# %% [markdown]
# ## Normalised depth
#
# Rendered depth and prior depth are each divided by their own largest value over the whole image, so the scale of the
# prior has no effect.
#
# $$
# m=\max_{p}\hat D_p,\qquad m_D=\max_{p}D_p,\qquad
# \mathcal L_D=\frac1n\sum_{p:\,V_p}\left|\frac{\hat D_p}{m}-\frac{D_p}{m_D}\right| .
# $$
#
# ## Smoothness
#
# $\mathcal Q$ keeps the depth smooth on tissue, away from depth edges $E$. The two total variations keep depth and
# colour flat under the instrument, where nothing is observed.
#
# $$
# \begin{aligned}
# \mathcal L_{\mathrm{smooth}}&=\mathcal Q(\hat D)+f\,\mathrm{TV}(\bar D)+f\,\mathrm{TV}(\bar I),\\
# \mathcal Q(\hat D)&=\frac{\sum_{(p,p')\in\mathcal P}[\nu_p\nu_{p'}]\,(\hat D_p-\hat D_{p'})^2}{\sum_p\nu_p+10^{-6}},\\
# \mathrm{TV}(x)&=\frac{1}{K\,H\,W}\sum_{c=1}^{K}\sum_{(p,p')\in\mathcal P}|x_{cp}-x_{cp'}|,
# \end{aligned}
# $$


# %% tags=["transcription"]
def depth_text(D_hat, D, M):
    V = M & (D > 0) & np.isfinite(D)
    m, m_D = D_hat.max(), D[(D > 0) & np.isfinite(D)].max()
    return np.abs(D_hat / m - D / m_D)[V].sum() / V.sum()


def smoothness_text(D_hat, I_hat, M, E, f):
    nu = M & ~E
    total = 0.0
    for axis in (0, 1):
        both = nu & np.roll(nu, -1, axis)
        both = both[:-1] if axis == 0 else both[:, :-1]
        total += (np.diff(D_hat, axis=axis) ** 2)[both].sum()
    Q = total / (nu.sum() + 1e-6)

    def TV(image):
        bar = np.where(M, 0, image)
        return (
            np.abs(np.diff(bar, axis=1)).sum() + np.abs(np.diff(bar, axis=2)).sum()
        ) / bar.size

    return Q + f * TV(D_hat[None]) + f * TV(I_hat)


# %%
prior = depth_target(D_prior, M)
L_D, saved_depth = normalised_depth_forward(D_hat, prior)
np.testing.assert_allclose(L_D, depth_text(D_hat, D_prior, M), rtol=1e-12)
np.testing.assert_allclose(
    normalised_depth_forward(D_hat, depth_target(7 * D_prior, M))[0], L_D, rtol=1e-12
)

# The maximum m_D runs over the instrument too: one finite prior there moves the loss, if it is
# the largest. A value that is not finite is no depth.
tool = tuple(np.argwhere(~M)[0])
for depth in (90.0, 0.9 * D_prior.max(), np.nan):
    on_tool = D_prior.copy()
    on_tool[tool] = depth
    moved = normalised_depth_forward(D_hat, depth_target(on_tool, M))[0]
    print(f"prior {depth:.0f} on the instrument: loss {L_D:.3f} -> {moved:.3f}")
    assert (moved == L_D) == (not depth > D_prior.max())
    np.testing.assert_allclose(moved, depth_text(D_hat, on_tool, M), rtol=1e-12)

step = D_hat + 80 * (np.arange(W) > 20)  # a fold, so that there is an edge
E = canny_edges(step)
assert E.any()
L_smooth, saved_smooth = smoothness_forward(step, I_hat, M, E, 30.0)
np.testing.assert_allclose(L_smooth, smoothness_text(step, I_hat, M, E, 30.0), rtol=1e-12)

# %% [markdown]
# ## Figure: why SSIM is used beside L1
#
# The three renders have **equal** masked L1, but the first looks much better. L1 does not distinguish them; SSIM does.
# (The maps show $1-s$, averaged over channels.)

# %% tags=["hide-input"]
from scipy.ndimage import gaussian_filter

blurred = gaussian_filter(I, (0, 1.2, 1.2)) - I
changes = {"brighter": np.ones_like(I), "noisy": rng.normal(size=I.shape), "blurred": blurred}
figure, axes = plt.subplots(2, 4, figsize=(13, 5), layout="constrained")
axes[0, 0].imshow(I.transpose(1, 2, 0))
axes[0, 0].set_title("observed")
axes[1, 0].imshow(M, cmap="gray")
axes[1, 0].set_title("mask")
scores = {}
for column, (name, change) in enumerate(changes.items(), start=1):
    render = I + change * (l1_text(blurred, 0 * I, M) / l1_text(change, 0 * I, M))
    scores[name] = masked_ssim_forward(render, target)[0]
    axes[0, column].imshow(np.clip(render, 0, 1).transpose(1, 2, 0))
    axes[0, column].set_title(
        f"{name}: L1 {l1_text(render, I, M):.3f}, SSIM {scores[name]:.3f}"
    )
    lost = np.where(M, 1 - ssim_map_text(np.where(M, render, 0), y)[0].mean(axis=0), np.nan)
    axes[1, column].imshow(lost, vmin=0, vmax=1, cmap="magma")
for panel in axes.flat:
    panel.set(xticks=[], yticks=[])
assert scores["brighter"] > scores["noisy"] and scores["brighter"] > scores["blurred"]
plt.show()

# %% [markdown]
# ## The reverse passes
#
# **L1.** The derivative of $|\cdot|$ is the sign, with $\operatorname{sign}(0)=0$.
#
# $$
# g_{\hat I_{cp}}=\begin{cases}\dfrac{g_{\mathcal L_1}}{3n}\operatorname{sign}(\hat I_{cp}-I_{cp}) & M_p\\ 0 & \text{otherwise,}\end{cases}\qquad \operatorname{sign}(0)=0 .
# $$
#
# **SSIM.** $s$ depends on $x$ through three windowed images, $k*x$, $k*x^2$ and $k*(xy)$; call the derivatives with
# respect to them $p$, $p_{xx}$, $p_{xy}$ (after $\sigma^2$ and $\sigma_{xy}$ are written out). The window is symmetric,
# so the reverse of $k*$ is $k*$ itself; $x^2$ gives the factor $2x$, and $xy$ the factor $y$:
#
# $$
# \begin{aligned}
# p&=\nu\left[\frac{2\mu_y(a_2-a_1)}{b_1b_2}-2\mu_x\,s\left(\frac1{b_1}-\frac1{b_2}\right)\right],\\
# p_{xx}&=-\nu\,\frac{s}{b_2},\qquad p_{xy}=\nu\,\frac{2a_1}{b_1b_2},\\
# g_{\hat I}&=\begin{cases}k*p+2x\,(k*p_{xx})+y\,(k*p_{xy}) & M\\0&\text{otherwise.}\end{cases}
# \end{aligned}
# $$
#
# **Depth.** The maximum is part of the formula, so the gradient at the largest pixel contains a sum over all pixels.
#
# $$
# g_{\hat D_p}=\frac{g_{\mathcal L_D}}{n}\left(\frac{\sigma_p}{m}-\frac{[\,p\in\mathcal P^\star]}{|\mathcal P^\star|}\,\frac{1}{m^2}\sum_{p'}\sigma_{p'}\hat D_{p'}\right).
# $$
#
# **Smoothness.** Each pixel has at most four neighbours.
#
# $$
# \begin{aligned}
# g_{\hat D_p}&=g\left[\frac{2\,\nu_p\sum_{p'\sim p}\nu_{p'}(\hat D_p-\hat D_{p'})}{\sum\nu+10^{-6}}
# +[\neg M_p]\,\frac{f}{HW}\sum_{p'\sim p}\operatorname{sign}(\bar D_p-\bar D_{p'})\right],\\
# g_{\hat I_{cp}}&=g\,[\neg M_p]\,\frac{f}{3HW}\sum_{p'\sim p}\operatorname{sign}(\bar I_{cp}-\bar I_{cp'}),
# \end{aligned}
# $$


# %% tags=["transcription"]
def ssim_reverse_text(g_S, x, y, M):
    s, (mu_x, mu_y, a_1, a_2, b_1, b_2) = ssim_map_text(x, y)
    nu = np.where(M, g_S / (3 * M.sum()), 0)
    p = nu * (2 * mu_y * (a_2 - a_1) / (b_1 * b_2) - 2 * mu_x * s * (1 / b_1 - 1 / b_2))
    p_xx, p_xy = -nu * s / b_2, nu * 2 * a_1 / (b_1 * b_2)
    return np.where(M, window(p) + 2 * x * window(p_xx) + y * window(p_xy), 0)


def depth_reverse_text(g, D_hat, D, M):
    V = M & (D > 0) & np.isfinite(D)
    m, m_D = D_hat.max(), D[D > 0].max()
    sigma = np.where(V, np.sign(D_hat / m - D / m_D), 0)
    P_star = D_hat == m
    return g / V.sum() * (sigma / m - P_star / P_star.sum() / m**2 * (sigma * D_hat).sum())


def over_neighbours(term, image):
    """sum over p' ~ p of term(image_p, image_p')"""
    total = np.zeros(image.shape)
    h, w = image.shape
    for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        here = np.s_[max(0, -dy) : h - max(0, dy), max(0, -dx) : w - max(0, dx)]
        there = np.s_[max(0, dy) : h - max(0, -dy), max(0, dx) : w - max(0, -dx)]
        total[here] += term(here, there)
    return total


def smoothness_reverse_text(g, D_hat, I_hat, M, E, f):
    nu = M & ~E
    squares = over_neighbours(lambda p, q: nu[q] * (D_hat[p] - D_hat[q]), D_hat)

    def signs(image):
        bar = np.where(M, 0, image)
        return over_neighbours(lambda p, q: np.sign(bar[p] - bar[q]), bar)

    g_D = g * (2 * nu * squares / (nu.sum() + 1e-6) + ~M * f / (H * W) * signs(D_hat))
    g_I = g * ~M * f / (3 * H * W) * np.array([signs(channel) for channel in I_hat])
    return g_I, g_D


# %%
n = M.sum()
np.testing.assert_allclose(
    masked_l1_reverse(0.9, saved_l1),
    np.where(M, 0.9 / (3 * n) * np.sign(I_hat - I), 0),
    rtol=1e-13,
)
np.testing.assert_allclose(
    masked_ssim_reverse(-0.1, saved_ssim),
    ssim_reverse_text(-0.1, x, y, M),
    rtol=1e-6,
    atol=1e-12,
)
np.testing.assert_allclose(
    normalised_depth_reverse(1.0, saved_depth),
    depth_reverse_text(1.0, D_hat, D_prior, M),
    rtol=1e-9,
    atol=1e-16,
)
for found, text in zip(
    smoothness_reverse(0.5, saved_smooth), smoothness_reverse_text(0.5, step, I_hat, M, E, 30.0)
):
    np.testing.assert_allclose(found, text, rtol=1e-11, atol=1e-18)

# %% [markdown]
# ## The exposure of a frame
#
# $$
# \tilde I_{cp}=e^{\gamma_{kc}}\,\hat I_{cp}+b_{kc}.
# $$
#
# The colour of every pixel of a channel goes through the same two numbers. So their gradients are sums over the pixels, and that
# of $\gamma_c$ has the factor $e^{\gamma_c}$ of the exponential.

# %%
gamma, b = rng.normal(0, 0.3, 3), rng.normal(0, 0.1, 3)
exposed, saved_exposure = exposure_forward(I_hat, gamma, b)
g_I = rng.normal(size=I_hat.shape)
found = exposure_reverse(g_I, saved_exposure)
for c in range(3):
    gain = np.exp(gamma[c])
    np.testing.assert_allclose(exposed[c], gain * I_hat[c] + b[c], rtol=1e-14)
    np.testing.assert_allclose(found.d_colour[c], gain * g_I[c], rtol=1e-14)
    np.testing.assert_allclose(
        found.d_log_gain[c], gain * (g_I[c] * I_hat[c]).sum(), rtol=1e-11
    )
    np.testing.assert_allclose(found.d_bias[c], g_I[c].sum(), rtol=1e-11)

# %% [markdown]
# ## The gradient check

# %%
with one_thread():
    names = ("masked_l1", "masked_ssim", "normalised_depth", "smoothness", "exposure")
    reports = [check_pair(all_pairs()[name], pair_stream(name, 0)) for name in names]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# The depth loss does not change when the rendered depth is multiplied by a constant. What follows for the sum
# $\sum_p g_{\hat D_p}\hat D_p$? Check it, and find the term of the gradient that makes it true.

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The derivative along D_hat itself is zero: the sum is 0. The term of the maximum
# makes it so: without it every pixel would be pulled, and the scale of the scene with them.
g_D = normalised_depth_reverse(1.0, saved_depth)
whole, without_largest = (g_D * D_hat).sum(), (g_D * D_hat)[D_hat < D_hat.max()].sum()
print(f"sum: {whole:.1e}; without the largest pixel: {without_largest:.2f}")
assert abs(whole) < 1e-12
assert abs(without_largest) > 1e-3
