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
# # 8. Colour that depends on the direction: spherical harmonics
#
# The colour of a wet surface depends on the direction from which it is seen. For each colour channel a Gaussian
# therefore has up to 16 coefficients of the real spherical harmonics. The harmonics are evaluated in the direction
# from the camera to the deformed centre of the Gaussian. The colour residual of {doc}`02_colour_residual` is added to
# the first coefficient.
#
# | Symbol | Meaning | Shape in the code |
# |---|---|---|
# | $h_{kci}$ | coefficient $k$ of channel $c$ and Gaussian $i$ | (16, 3, N) |
# | $\Delta h_{0,ci}$ | colour residual | (3, N) |
# | $Y_k$ | real spherical harmonic; $Y_0=Y_{00}$ is constant | |
# | $K$ | number of active functions, $(\text{degree}+1)^2$; the degree is 0 to 3 | |
# | $\mu_i(t)$, $\mathbf o$ | deformed centre of Gaussian $i$, and optical centre of the camera, in the world | (3, N), (3,) |
# | $\mathbf n_i=(x,y,z)$ | unit vector from the camera to the Gaussian | (3, N) |
# | $rgb_{ci}$ | displayed colour | (3, N) |
#
# The equation is {eq}`eq-b4` of {doc}`/specification/b04_harmonics`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import math

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import harmonics as definition
from endotsr.method.splatting.harmonics import harmonics_forward, harmonics_reverse
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

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
# Each $Y_k$ is a polynomial in $x,y,z$ of degree at most 3. The definition stores it as a common factor and a list of
# monomials, each with its coefficient and its exponents. A Gaussian at the camera itself has no direction, and its
# $\mathbf n$ is set to 0.

# %%
for k, (factor, polynomial) in enumerate(definition.POLYNOMIALS):
    terms = [f"{c:+d} x^{i} y^{j} z^{m}" for c, i, j, m in polynomial]
    print(f"Y_{k:<2d} = {factor:+.6f} (" + " ".join(terms) + ")")

# %% [markdown]
# <!-- definition: endotsr.definition.harmonics.basis -->
# ```python
# def basis(direction, terms):
#     """Y_k (terms, N) of directions (3, N)."""
#     x, y, z = direction
#     return np.array([f * sum(c * x**i * y**j * z**k for c, i, j, k in p) for f, p in POLYNOMIALS[:terms]])
# ```
#
# <!-- definition: endotsr.definition.harmonics.directions -->
# ```python
# def directions(position, centre):
#     """Unit vectors (3, N) from the optical centre, and 1 / distance (N,); both 0 at the centre itself."""
#     v = position - centre[:, None]
#     length = np.sqrt((v * v).sum(axis=0))
#     inverse = np.where(length == 0, 0, 1 / np.where(length == 0, 1, length))
#     return v * inverse, inverse
# ```
#
# <!-- definition: endotsr.definition.harmonics.harmonics_forward -->
# ```python
# def harmonics_forward(harmonics, residual, position, centre, degree):
#     """Equation (B4): display colour (3, N), clamped to at least 0.
#
#     From coefficients (K, 3, N), K >= (degree + 1)^2, residual (3, N) or None, positions (3, N) and the centre (3,).
#     """
#     terms = (degree + 1) ** 2
#     y = basis(directions(position, centre)[0], terms)
#     colour = 0.5 + np.einsum("kn,kcn->cn", y, harmonics[:terms]) + (0 if residual is None else Y00 * residual)
#     saved = HarmonicsSaved(harmonics, residual, position, centre, degree, colour.real < 0)
#     return np.where(colour.real < 0, 0, colour), saved
# ```

# %%
h, residual = rng.normal(0, 0.6, (16, 3, N)), rng.normal(0, 0.3, (3, N))
mu, centre = rng.normal(0, 1, (3, N)) + [[0], [0], [4]], rng.normal(0, 0.4, 3)
for degree in range(4):
    colour, saved = harmonics_forward(h, residual, mu, centre, degree)
    text, text_saved = definition.harmonics_forward(h, residual, mu, centre, degree)
    np.testing.assert_allclose(colour, text, rtol=1e-11, atol=1e-13)
assert saved.clamped.any() and colour.max() > 1, "clamped at 0; not clamped at 1"

# %% [markdown]
# **An independent source.** The same sixteen functions follow from the associated Legendre functions
# $P_l^m(x)=(-1)^m(1-x^2)^{m/2}\,P_l^{(m)}(x)$. Here $P_l^{(m)}$ is the derivative of order $m$ of the Legendre
# polynomial $P_l$, which NumPy provides. The polynomials listed above and these functions share the sign convention
# $(-1)^m$ of Condon and Shortley.

# %%
direction = rng.normal(size=(3, 50))
direction /= np.linalg.norm(direction, axis=0)
height, azimuth = direction[2], np.arctan2(direction[1], direction[0])
k = 0
for band in range(4):
    for m in range(-band, band + 1):
        norm = np.sqrt((2 * band + 1) / (4 * np.pi) / math.perm(band + abs(m), 2 * abs(m)))
        wave = (
            1
            if m == 0
            else np.sqrt(2) * (np.cos(m * azimuth) if m > 0 else np.sin(-m * azimuth))
        )
        legendre = np.polynomial.Legendre.basis(band).deriv(abs(m))(height)
        associated = (-np.sqrt(1 - height**2)) ** abs(m) * legendre
        real = norm * wave * associated
        np.testing.assert_allclose(definition.basis(direction, 16)[k], real, atol=1e-13)
        k += 1

# %% [markdown]
# ## Figure: the sixteen functions
#
# Each function is drawn over the whole sphere, with the longitude to the right and the latitude upwards. Red is
# positive and blue is negative. The values are those of the compiled function, for one Gaussian per direction and one
# coefficient that is not 0. Before you look, imagine that the camera moves to the opposite side of a Gaussian, so that
# $\mathbf n$ becomes $-\mathbf n$. In which rows of the figure does every function change its sign?

# %% tags=["hide-input"]
lon, lat = np.meshgrid(np.linspace(-np.pi, np.pi, 73), np.linspace(-np.pi / 2, np.pi / 2, 37))
around = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]).reshape(
    3, -1
)
figure = plt.figure(figsize=(10.1, 5.2), layout="constrained")
grid = figure.add_gridspec(4, 7)
for band in range(4):
    for m in range(-band, band + 1):
        k = band * (band + 1) + m
        alone = np.zeros((16, 3, around.shape[1]))
        alone[k] = 0.4  # small enough that 1/2 + 0.4 Y stays above the clamp
        value = (harmonics_forward(alone, None, around, np.zeros(3), 3)[0][0] - 0.5) / 0.4
        np.testing.assert_allclose(value, definition.basis(around, 16)[k], atol=1e-12)
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
    np.einsum(
        "ku,lu,u->kl", definition.basis(around, 16), definition.basis(around, 16), weights
    )
    * (2 * np.pi / 73)
    * (np.pi / 36)
)
assert np.abs(gram - np.eye(16)).max() < 0.05, "orthonormal on the sphere"
plt.show()
sign = (-1.0) ** np.repeat([0, 1, 2, 3], [1, 3, 5, 7])[:, None]
opposite = definition.basis(-around, 16)
np.testing.assert_allclose(opposite, sign * definition.basis(around, 16), atol=1e-14)

# %% [markdown]
# In the second and in the fourth row, whose polynomials have the odd degrees 1 and 3.

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_{rgb}$ is given, and we need the gradients with respect to the coefficients, the residual, the centre of each
# Gaussian and the optical centre of the camera.
#
# **(8.1) The clamp.** Let $g^{\mathrm{pre}}$ be the gradient with respect to the argument of $\max(0,\cdot)$. Where
# the argument is at least 0, $g^{\mathrm{pre}}=g_{rgb}$. Where it is negative, $g^{\mathrm{pre}}=0$.
#
# **(8.2) The coefficients.** The colour is linear in $h_k$, with the factor $Y_k(\mathbf n)$, so
# $g_{h_k}=Y_k\,g^{\mathrm{pre}}$. The residual is added to $h_0$ and has the same factor $Y_0$.
#
# **(8.3) The direction.** The three channels share $\mathbf n$, so their contributions add up. Each coefficient
# contributes the slope of its polynomial:
# $g_{\mathbf n}=\sum_k\bigl(\sum_cg^{\mathrm{pre}}_ch_{kc}\bigr)\,\partial Y_k/\partial(x,y,z)$. The constant $Y_0$
# has the slope 0, so the sum begins at $k=1$.
#
# **(8.4) The slope of a monomial.** With $x,y,z$ taken as independent,
# $\partial(x^py^qz^r)/\partial x=p\,x^{p-1}y^qz^r$. The resulting gradient also has a component along $\mathbf n$,
# which (8.5) removes.
#
# **(8.5) The normalisation.** From $\mathbf n=\mathbf v/\|\mathbf v\|$ follows
# $\mathrm d\mathbf n=(I-\mathbf n\mathbf n^\top)\,\mathrm d\mathbf v/\|\mathbf v\|$. The gradient $g_{\mathbf v}$ is
# therefore the component of $g_{\mathbf n}$ perpendicular to $\mathbf n$, divided by the distance. Step (6.8) has the
# same rule for the quaternion. At the camera itself $g_{\mathbf v}$ is set to 0.
#
# **(8.6) The two ends.** Since $\mathbf v=\mu-\mathbf o$, the centre of the Gaussian receives $+g_{\mathbf v}$. All
# Gaussians share the optical centre, which receives $-\sum_ig_{\mathbf v_i}$.
#
# $$
# \begin{aligned}
# g_{h_{kci}}&=Y_k(\mathbf n_i)\,g^{\mathrm{pre}}_{ci},\qquad g_{\Delta h_{0,ci}}=g_{h_{0ci}},\\
# g_{\mathbf n_i}&=\sum_{k\ge1}\Bigl(\sum_c g^{\mathrm{pre}}_{ci}h_{kci}\Bigr)\frac{\partial Y_k}{\partial(x,y,z)},\qquad
# g_{\mathbf v_i}=\frac{g_{\mathbf n_i}-(\mathbf n_i\cdot g_{\mathbf n_i})\,\mathbf n_i}{\|\mathbf v_i\|},\\
# g_{\mu_i}&\mathrel{+}=g_{\mathbf v_i},\qquad g_{\mathbf o}=-\sum_i g_{\mathbf v_i} .
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.harmonics.basis_slopes -->
# ```python
# def basis_slopes(direction, terms):
#     """dY_k / d(x, y, z), (terms, 3, N), for independent x, y, z."""
#     out = np.zeros((terms, *direction.shape), direction.dtype)
#     for row, (factor, polynomial) in enumerate(POLYNOMIALS[:terms]):
#         for c, *powers in polynomial:
#             for axis in np.flatnonzero(powers):
#                 x, y, z = (d ** (p - (axis == i)) for i, (d, p) in enumerate(zip(direction, powers)))
#                 out[row, axis] += factor * c * powers[axis] * x * y * z  # (8.4)
#     return out
# ```
#
# <!-- definition: endotsr.definition.harmonics.harmonics_reverse -->
# ```python
# def harmonics_reverse(d_colour, saved):
#     """Reverse of (B4): through the coefficients and through the viewing direction."""
#     harmonics, residual, position, centre, degree, clamped = saved
#     terms = (degree + 1) ** 2
#     g = np.where(clamped, 0, d_colour)  # ruling "harmonics": gradient 0 where below 0; (8.1)
#     n, inverse = directions(position, centre)
#     d_harmonics = np.zeros_like(harmonics)
#     d_harmonics[:terms] = np.einsum("kn,cn->kcn", basis(n, terms), g)  # (8.2)
#     d_n = np.einsum("cn,kcn,kan->an", g, harmonics[:terms], basis_slopes(n, terms))  # (8.3)
#     d_v = (d_n - (n * d_n).sum(axis=0) * n) * inverse  # (8.5)
#     return HarmonicsGrads(d_harmonics, None if residual is None else Y00 * g, d_v, -d_v.sum(axis=1))  # (8.6)
# ```

# %%
g_rgb = rng.normal(size=(3, N))
grads = harmonics_reverse(g_rgb, saved)
text = definition.harmonics_reverse(g_rgb, text_saved)
for found, expected in zip(grads, text):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)

# Euler: a homogeneous polynomial of degree l has the slope l Y along n.
# (8.5) removes that part.
n, _ = definition.directions(mu, centre)
along = np.einsum("kan,an->kn", definition.basis_slopes(n, 16), n)
powers = np.array([sum(p[0][1:]) for _, p in definition.POLYNOMIALS])
np.testing.assert_allclose(along, powers[:, None] * definition.basis(n, 16), atol=1e-13)

# %% [markdown]
# ## The gradient check
#
# The check has one pair of a forward and a reverse pass for each active degree.

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
# 1. All coefficients of a Gaussian above degree 0 are 0. Which gradients vanish, and does this follow from (8.2) or
#    from (8.3)?
# 2. Write `harmonics_reverse` from (8.1) to (8.6) and let the golden cases judge it: `--only harmonics` ({doc}`index`).
#    One case has a Gaussian at the camera itself.
# 3. The cell below answers this one. Mirror the scene: negate $x$ of all positions and of the camera. Which
#    coefficients must change their sign so that every Gaussian keeps its colour? Find the answer in the list of
#    polynomials, then check it with the kernel.

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
