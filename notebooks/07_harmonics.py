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
# # 7. Colour that depends on the direction: spherical harmonics
#
# The colour of a wet surface depends on the viewing direction. Each Gaussian has up to 16 coefficients of the real
# spherical harmonics per channel. They are evaluated in the direction from the camera to the deformed centre. The
# colour residual of {doc}`02_colour_residual` is added to the first of them.
#
# The equation is {eq}`eq-b4` of {doc}`/specification/b04_harmonics`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import matplotlib.pyplot as plt
import numpy as np
from scipy.special import factorial, lpmv

from endotsr.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.splatting.harmonics import harmonics_forward, harmonics_reverse

# %%
rng = np.random.default_rng(7)
N = 9

# %% [markdown]
# ## The equation
#
# $$
# \begin{aligned}
# \mathbf v_i&=\mu_i(t)-\mathbf o,\qquad \mathbf n_i=\frac{\mathbf v_i}{\|\mathbf v_i\|},\\
# rgb_{ci}&=\max\Bigl(0,\ \tfrac12+Y_0\,(h_{0ci}+\Delta h_{0,ci})+\sum_{k=1}^{K-1}Y_k(\mathbf n_i)\,h_{kci}\Bigr).
# \end{aligned}
# $$
#
# The specification has the table of the $Y_k$ and their derivatives. It is transcribed here with its closed-form
# constants.

# %% tags=["transcription"]
C_0, C_1 = np.sqrt(1 / (4 * np.pi)), np.sqrt(3 / (4 * np.pi))
C_2a, C_2b, C_2c = (
    np.sqrt(15 / (4 * np.pi)),
    np.sqrt(5 / (16 * np.pi)),
    np.sqrt(15 / (16 * np.pi)),
)
C_3a, C_3b, C_3c = (
    np.sqrt(35 / (32 * np.pi)),
    np.sqrt(105 / (4 * np.pi)),
    np.sqrt(21 / (32 * np.pi)),
)
C_3d, C_3e = np.sqrt(7 / (16 * np.pi)), np.sqrt(105 / (16 * np.pi))


def Y_text(x, y, z):
    return np.array(
        [
            np.full_like(x, C_0),
            -C_1 * y,
            C_1 * z,
            -C_1 * x,
            C_2a * x * y,
            -C_2a * y * z,
            C_2b * (2 * z**2 - x**2 - y**2),
            -C_2a * x * z,
            C_2c * (x**2 - y**2),
            -C_3a * y * (3 * x**2 - y**2),
            C_3b * x * y * z,
            -C_3c * y * (4 * z**2 - x**2 - y**2),
            C_3d * z * (2 * z**2 - 3 * x**2 - 3 * y**2),
            -C_3c * x * (4 * z**2 - x**2 - y**2),
            C_3e * z * (x**2 - y**2),
            -C_3a * x * (x**2 - 3 * y**2),
        ]
    )


def colour_text(h, Delta_h0, mu, o, degree):
    v = mu - o[:, None]
    n = v / np.sqrt((v**2).sum(axis=0))
    Y = Y_text(*n)
    before = (
        1 / 2 + Y[0] * (h[0] + Delta_h0) + sum(Y[k] * h[k] for k in range(1, (degree + 1) ** 2))
    )
    return np.maximum(0, before)


# %%
h, residual = rng.normal(0, 0.6, (16, 3, N)), rng.normal(0, 0.3, (3, N))
mu, centre = rng.normal(0, 1, (3, N)) + [[0], [0], [4]], rng.normal(0, 0.4, 3)
for degree in range(4):
    colour, saved = harmonics_forward(h, residual, mu, centre, degree)
    np.testing.assert_allclose(
        colour, colour_text(h, residual, mu, centre, degree), rtol=1e-11, atol=1e-13
    )
assert saved.clamped.any() and colour.max() > 1, "clamped at 0; not clamped at 1"

# %% [markdown]
# **An independent source.** The associated Legendre functions $P_l^m$ of SciPy give the same sixteen functions. Their
# sign $(-1)^m$ (Condon and Shortley) is that of the table.

# %%
direction = rng.normal(size=(3, 50))
direction /= np.linalg.norm(direction, axis=0)
polar, azimuth = np.arccos(direction[2]), np.arctan2(direction[1], direction[0])
k = 0
for band in range(4):
    for m in range(-band, band + 1):
        norm = np.sqrt(
            (2 * band + 1) / (4 * np.pi) * factorial(band - abs(m)) / factorial(band + abs(m))
        )
        wave = (
            1
            if m == 0
            else np.sqrt(2) * (np.cos(m * azimuth) if m > 0 else np.sin(-m * azimuth))
        )
        real = norm * wave * lpmv(abs(m), band, np.cos(polar))
        np.testing.assert_allclose(Y_text(*direction)[k], real, atol=1e-13)
        k += 1

# %% [markdown]
# ## Figure: the sixteen functions
#
# Each function is drawn over the whole sphere (longitude to the right, latitude upwards); red is positive and blue is
# negative. The kernel evaluates them, with one Gaussian per direction and one coefficient set to 1.

# %% tags=["hide-input"]
lon, lat = np.meshgrid(np.linspace(-np.pi, np.pi, 73), np.linspace(-np.pi / 2, np.pi / 2, 37))
around = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]).reshape(
    3, -1
)
figure = plt.figure(figsize=(13, 6), layout="constrained")
grid = figure.add_gridspec(4, 7)
for band in range(4):
    for m in range(-band, band + 1):
        k = band * (band + 1) + m
        alone = np.zeros((16, 3, around.shape[1]))
        alone[k] = 0.4  # small enough that 1/2 + 0.4 Y stays above the clamp
        value = (harmonics_forward(alone, None, around, np.zeros(3), 3)[0][0] - 0.5) / 0.4
        np.testing.assert_allclose(value, Y_text(*around)[k], atol=1e-12)
        panel = figure.add_subplot(grid[band, 3 + m])
        panel.imshow(
            value.reshape(lon.shape),
            cmap="RdBu_r",
            vmin=-1,
            vmax=1,
            origin="lower",
            aspect="auto",
        )
        panel.set_title(f"$Y_{{{k}}}$", fontsize=10)
        panel.axis("off")
weights = np.cos(lat).ravel()
gram = (
    np.einsum("ku,lu,u->kl", Y_text(*around), Y_text(*around), weights)
    * (2 * np.pi / 73)
    * (np.pi / 36)
)
assert np.abs(gram - np.eye(16)).max() < 0.05, "orthonormal on the sphere"
plt.show()

# %% [markdown]
# ## The reverse pass
#
# The colour is linear in the coefficients. The clamp passes the gradient where the value before it is $\ge0$. The
# direction is $\mathbf n=\mathbf v/\|\mathbf v\|$: only the part of $g_{\mathbf n}$ that is perpendicular to
# $\mathbf n$ remains, divided by the distance. This is the rule of the quaternion, because the normalisation is the
# same.
#
# $$
# \begin{aligned}
# g_{h_{kci}}&=Y_k(\mathbf n_i)\,g^{\mathrm{pre}}_{ci},\qquad g_{\Delta h_{0,ci}}=g_{h_{0ci}},\\
# g_{\mathbf n_i}&=\sum_{k\ge1}\Bigl(\sum_c g^{\mathrm{pre}}_{ci}h_{kci}\Bigr)\frac{\partial Y_k}{\partial(x,y,z)},\qquad
# g_{\mathbf v_i}=\frac{g_{\mathbf n_i}-(\mathbf n_i\cdot g_{\mathbf n_i})\,\mathbf n_i}{\|\mathbf v_i\|},\\
# g_{\mu_i}&\mathrel{+}=g_{\mathbf v_i},\qquad g_{\mathbf o}=-\sum_i g_{\mathbf v_i} .
# \end{aligned}
# $$


# %% tags=["transcription"]
def dY_text(x, y, z):
    """The right column of the table: d/dx, d/dy, d/dz, taken as independent. (16, 3)"""
    return np.array(
        [
            [0, 0, 0],
            [0, -C_1, 0],
            [0, 0, C_1],
            [-C_1, 0, 0],
            [C_2a * y, C_2a * x, 0],
            [0, -C_2a * z, -C_2a * y],
            [-C_2b * 2 * x, -C_2b * 2 * y, C_2b * 4 * z],
            [-C_2a * z, 0, -C_2a * x],
            [C_2c * 2 * x, -C_2c * 2 * y, 0],
            [-C_3a * 6 * x * y, -C_3a * (3 * x**2 - 3 * y**2), 0],
            [C_3b * y * z, C_3b * x * z, C_3b * x * y],
            [C_3c * 2 * x * y, -C_3c * (4 * z**2 - x**2 - 3 * y**2), -C_3c * 8 * y * z],
            [-C_3d * 6 * x * z, -C_3d * 6 * y * z, C_3d * (6 * z**2 - 3 * x**2 - 3 * y**2)],
            [-C_3c * (4 * z**2 - 3 * x**2 - y**2), C_3c * 2 * x * y, -C_3c * 8 * x * z],
            [C_3e * 2 * x * z, -C_3e * 2 * y * z, C_3e * (x**2 - y**2)],
            [-C_3a * (3 * x**2 - 3 * y**2), C_3a * 6 * x * y, 0],
        ]
    )


def reverse_text(g_rgb, h, Delta_h0, mu, o):
    g_h, g_mu, g_o = np.zeros_like(h), np.zeros_like(mu), np.zeros(3)
    for i in range(mu.shape[1]):
        v = mu[:, i] - o
        distance = np.sqrt((v**2).sum())
        n = v / distance
        Y = Y_text(*n)
        before = 1 / 2 + Y[0] * Delta_h0[:, i] + Y @ h[:, :, i]
        g_pre = np.where(before >= 0, g_rgb[:, i], 0)
        g_h[:, :, i] = Y[:, None] * g_pre
        g_n = (h[:, :, i] @ g_pre) @ dY_text(*n)
        g_v = (g_n - (n @ g_n) * n) / distance
        g_mu[:, i] = g_v
        g_o -= g_v
    return g_h, g_h[0], g_mu, g_o


# %%
g_rgb = rng.normal(size=(3, N))
grads = harmonics_reverse(g_rgb, saved)
for found, text in zip(grads, reverse_text(g_rgb, h, residual, mu, centre)):
    np.testing.assert_allclose(found, text, rtol=1e-9, atol=1e-12)

# %% [markdown]
# ## The gradient check
#
# There is one pair per active degree.

# %%
with one_thread():
    reports = [
        check_pair(
            all_pairs()[f"harmonics_degree_{d}"], pair_stream(f"harmonics_degree_{d}", 0)
        )
        for d in range(4)
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# Mirror the scene: negate $x$ of all positions and of the camera. Which coefficients must change their sign so that
# every Gaussian keeps its colour? Find the answer in the table, then check it with the kernel.

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. Those whose Y_k is odd in x: k = 3, 4, 7, 10, 13, 15. (Y_14 = z (x^2 - y^2) is even.)
odd = [3, 4, 7, 10, 13, 15]
mirror = np.array([-1.0, 1, 1])
flipped = h.copy()
flipped[odd] *= -1
np.testing.assert_allclose(
    harmonics_forward(flipped, residual, mirror[:, None] * mu, mirror * centre, 3)[0],
    colour,
    atol=1e-12,
)
