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
# # 2. The bounded colour residual (component A)
#
# Colours change during a clip: the exposure drifts, and tissue becomes pale under pressure. Component A lets the
# colour of each Gaussian follow such a change. Whatever its coefficients are, the displayed colour differs from that
# without A by at most $\beta$. This bound limits the size of the residual. It does not limit what the residual
# represents, as the end of the next section shows.
#
# | Symbol | Meaning | Shape in the code |
# |---|---|---|
# | $A_{cki}$ | coefficients: colour channel $c$, atom $k$, Gaussian $i$ | (3, 2F, N) |
# | $\bar\phi_k(t)$ | normalised atoms of {doc}`01_dictionary` | (2F,) |
# | $\beta$ | bound of the change of displayed colour by the residual; 0.3 in `paper` | |
# | $x_{ci}(t)$ | argument of the residual | (3, N) |
# | $\Delta h_{0,ci}(t)$ | the residual, added to the degree-0 harmonic coefficient $h_0$ | (3, N) |
# | $Y_{00}$ | the constant spherical harmonic | |
#
# The equation is {eq}`eq-2` of {doc}`/specification/02_appearance`; {doc}`01_dictionary` introduces the atoms.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import appearance as definition
from endotsr.method.equations.appearance import Y00, appearance_forward, appearance_reverse
from endotsr.method.equations.dictionary import atom_statistics, frequencies, normalised_atoms
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %%
rng = np.random.default_rng(2)
F, N, beta = 8, 150, 0.3
omega = frequencies(F, 1.0, 16.0)
stamps = np.delete(np.arange(63), np.arange(1, 63, 8)) / 63
statistics = atom_statistics(stamps, omega)

# %% [markdown]
# ## The equation
#
# $$
# x_{ci}(t) = \sum_{k=1}^{2F} A_{cki}\,\bar\phi_k(t),\qquad
# \Delta h_{0,ci}(t) = \frac{\beta}{Y_{00}}\tanh x_{ci}(t),\qquad Y_{00}=\frac{1}{\sqrt{4\pi}} .
# $$
#
# **(2.1) The unit.** The residual is added to the degree-0 harmonic coefficient $h_0$, and the displayed colour is
# $Y_{00}h_0+\dots+\tfrac12$. To change the displayed colour by $\beta\tanh x$, the residual must therefore be
# $\Delta h_0=\frac{\beta}{Y_{00}}\tanh x$.
#
# **(2.2) The bound.** Since $|\tanh x|\le1$, the residual changes the displayed colour by at most $\beta$ for any
# coefficients. From one time to another the colour can therefore change by up to $2\beta$.
#
# <!-- definition: endotsr.definition.appearance.appearance_forward -->
# ```python
# def appearance_forward(appearance_coefficients, phi_bar, beta):
#     """Equation (2): residual (3, N) = beta / Y00 tanh(A phi_bar), to be added to the degree-0 coefficient."""
#     x = np.einsum("ckn,k->cn", appearance_coefficients, phi_bar)
#     return beta / Y00 * np.tanh(x), AppearanceSaved(appearance_coefficients, phi_bar, beta)  # (2.1)
# ```

# %%
A = rng.normal(0, 0.4, (3, 2 * F, N))
for t in (0.0, 0.2, 0.77):
    phi_bar = normalised_atoms(t, omega, statistics)
    residual, saved = appearance_forward(A, phi_bar, beta)
    np.testing.assert_allclose(
        residual, definition.appearance_forward(A, phi_bar, beta)[0], rtol=1e-13
    )
assert np.abs(Y00 * appearance_forward(1e6 * A, phi_bar, beta)[0]).max() <= beta * (1 + 1e-15)

# %% [markdown]
# **Identity at the start.** The coefficients start at $A=0$, where the residual is exactly 0. At the iteration that
# activates the component, the model therefore renders the same image as before, bit for bit.

# %%
zero = np.zeros_like(A)
assert not np.any(appearance_forward(zero, phi_bar, beta)[0])

# %% [markdown]
# **The limit of the bound.** Each Gaussian has its own coefficients, so neighbours may change in opposite directions.
# Consider a texture that moves across Gaussians that do not move. Its contrast, from the darkest to the brightest place,
# is 0.28; the bound of 0.3 in both directions would allow 0.6. The residual can reproduce this motion of the texture. The
# bound alone does not distinguish such a texture from a change of the light.

# %%
place = np.linspace(0, 1, N)
sine, cosine = (F * k for k in (0, 1))  # the atoms of one cycle
grating = np.zeros((3, 2 * F, N))
grating[:, sine], grating[:, cosine] = np.cos(40 * place), np.sin(40 * place)
grating *= 0.35
frames = [
    Y00 * appearance_forward(grating, normalised_atoms(t, omega, statistics), beta)[0][0]
    for t in stamps
]
contrast = max(frame.max() - frame.min() for frame in frames)
moved = max(np.abs(frame - frames[0]).max() for frame in frames)
print(f"contrast within a frame {contrast:.2f}, change over time {moved:.2f}, bound {beta}")
waves = [np.sin(2 * np.pi * t + 40 * place) for t in stamps]  # they move with time
assert min(np.corrcoef(wave, frame)[0, 1] for wave, frame in zip(waves, frames)) > 0.99
assert round(contrast, 2) == round(moved, 2) == 0.28 and np.abs(frames).max() < beta

# %% [markdown]
# ## Figure: brightening explained by colour, or by motion
#
# A patch of tissue becomes paler and recovers, without moving. The left panel shows how component A represents the
# event: the colour changes over time. A model without A has constant colour coefficients. It can make a pixel brighter at
# one time by moving, turning or scaling Gaussians. The middle panel shows an example: a bright neighbour four pixels away is
# shifted so that the pixel has the brightness of the patch at each time. How far do you expect it to move? In both
# cases the image at this pixel is right, but in the second case the geometry is wrong. The paper gives colour and
# motion separate components. (The right panel belongs to step (2.4).)

# %% tags=["hide-input"]
fine = np.linspace(0, 0.98, 197)
target = 0.45 + 0.2 * np.exp(-(((fine - 0.55) / 0.12) ** 2))  # display brightness of a patch
phis = np.array([normalised_atoms(t, omega, statistics) for t in fine])
# The base colour at which the argument x has mean 0, as every x must.
choices = np.linspace(0.4, 0.6, 2001)
base = min(choices, key=lambda b: abs(np.arctanh((target - b) / beta).mean()))
wanted = np.arctanh((target - base) / beta)
coefficients = np.linalg.lstsq(phis, wanted, rcond=None)[0]
one = np.zeros((3, 2 * F, 1))
one[:, :, 0] = coefficients
by_colour = base + np.array([Y00 * appearance_forward(one, p, beta)[0][0, 0] for p in phis])
assert np.abs(by_colour - target).max() < 0.02

# without A: a bright Gaussian (0.7) next to a dull one (0.45); the mixture at the pixel
# depends on how far it is
distance = np.linspace(4, 0, 400)
mixed = 0.45 + 0.25 * np.exp(-(distance**2) / 3)
by_motion = distance[np.searchsorted(mixed, target.clip(mixed[0], mixed[-1])).clip(max=399)]
assert 4 - by_motion.min() > 2, "the motion that explains the light is pixels, not noise"

figure, axes = plt.subplots(1, 3, figsize=(10.1, 3.1), layout="constrained")
axes[0].plot(fine, target, color="0.6", lw=4, label="brightness of the patch")
axes[0].plot(fine, by_colour, color="tab:blue", lw=1.5, label="base + $\\beta\\tanh x(t)$")
axes[0].axhspan(
    base - beta, base + beta, color="tab:blue", alpha=0.08, label="all that A can reach"
)
axes[0].set(title="explained by colour", xlabel="t", ylabel="display colour", ylim=(0.1, 0.9))
axes[0].legend(loc="lower left")
axes[1].plot(fine, 4 - by_motion, color="tab:red", label="shift of a bright neighbour, no A")
axes[1].axhline(0, color="tab:blue", label="true motion, and that with A")
axes[1].set(
    title="explained by motion", xlabel="t", ylabel="displacement [px]", ylim=(-0.2, 4.6)
)
axes[1].legend(loc="upper left")
x = np.linspace(0, 14, 300)
e = np.exp(-2 * x.astype(np.float32))
axes[2].semilogy(
    x,
    np.maximum(1 - np.tanh(x.astype(np.float32)) ** 2, 1e-14),
    color="tab:red",
    label="$1-\\tanh^2x$",
)
axes[2].semilogy(
    x, 4 * e / (1 + e) ** 2, color="tab:green", label="$4e/(1+e)^2,\\ e=\\exp(-2|x|)$"
)
axes[2].set(title="slope of tanh in float32", xlabel="x", ylim=(1e-13, 2))
axes[2].legend()
plt.show()

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_{\Delta h_0}$ is given for each channel and Gaussian, and we need the gradients with respect to the
# coefficients $A$ and to the atoms $\bar\phi$.
#
# **(2.3) The slope.** The derivative of the hyperbolic tangent is $1/\cosh^2x$, so
# $g_x=\frac{\beta}{Y_{00}}\,g_{\Delta h_0}/\cosh^2x$.
#
# **(2.4) A slope that keeps its digits.** The identity $1/\cosh^2x=1-\tanh^2x$ suggests the right side as a formula.
# In float32 it loses its digits one by one as $x$ grows (right panel above). Correctly rounded, $\tanh x$ is 1 from
# $x=13\ln2\approx9.01$ on, and the computed slope is then exactly 0: a saturated residual has no gradient. The stable
# form uses $e=\exp(-2|x|)$. With it $\cosh x=(1+e)/(2\sqrt e)$, so the slope is $4e/(1+e)^2$. This form contains no
# subtraction and cannot overflow.
#
# **(2.5) One coefficient** is multiplied by one atom, $\partial x_{ci}/\partial A_{cki}=\bar\phi_k$, which gives
# $g_{A_{cki}}=g_{x_{ci}}\bar\phi_k$.
#
# **(2.6) One atom** is multiplied by the coefficients of all Gaussians and channels, so its gradient is the sum over
# both.
#
# **(2.7) At the start** of component A, $A=0$ and $x=0$, so $e=1$ and the slope is 1. The gradient with respect to $A$
# is $\frac{\beta}{Y_{00}}\bar\phi\,g_{\Delta h_0}$. It is in general not 0, so the first step changes $A$.
#
# $$
# g_{x_{ci}} = \frac{\beta}{Y_{00}}\,\frac{4e_{ci}}{(1+e_{ci})^2}\;g_{\Delta h_{0,ci}},\qquad
# g_{A_{cki}} = g_{x_{ci}}\,\bar\phi_k,\qquad
# g_{\bar\phi_k} = \sum_{i=1}^{N}\sum_{c=1}^{3} g_{x_{ci}}\,A_{cki} .
# $$
#
# <!-- definition: endotsr.definition.appearance.appearance_reverse -->
# ```python
# def appearance_reverse(d_residual, saved):
#     """Reverse of (2). The kernel writes 1 / cosh^2 as 4 e / (1 + e)^2, e = exp(-2 |x|), in which nothing overflows."""
#     a, phi_bar, beta = saved
#     with np.errstate(over="ignore"):
#         slope = beta / Y00 * (1 / np.cosh(np.einsum("ckn,k->cn", a, phi_bar))) ** 2  # (2.3)
#     d_x = slope * d_residual
#     return AppearanceGrads(np.einsum("cn,k->ckn", d_x, phi_bar), np.einsum("cn,ckn->k", d_x, a))  # (2.5), (2.6)
# ```

# %%
g_h = rng.normal(size=(3, N))
grads = appearance_reverse(g_h, appearance_forward(A, phi_bar, beta)[1])
g_A, g_phi_bar = definition.appearance_reverse(g_h, (A, phi_bar, beta))
np.testing.assert_allclose(grads.d_appearance_coefficients, g_A, rtol=1e-12)
np.testing.assert_allclose(grads.d_phi_bar, g_phi_bar, rtol=1e-11)

x = np.linspace(8, 10.5, 2501)
rounded = 1 - np.tanh(x).astype(np.float32) ** 2  # tanh correctly rounded to float32
assert np.all((rounded == 0) == (x > 13 * np.log(2))), "(2.4): 0 from 13 ln 2 on"
assert np.abs(rounded[x > 8.9] * np.cosh(x[x > 8.9]) ** 2 - 1).max() > 0.5, "no digit is right"
units = np.linspace(range(1, 9), range(2, 10), 101)  # x from 1 to 2, from 2 to 3, ...
left = (1 - np.tanh(units).astype(np.float32) ** 2) * np.cosh(units) ** 2
lost = np.log10(np.abs(left - 1).max(axis=0))
assert (np.diff(lost) > 0.5).all(), "(2.4): digit by digit"

saturated = appearance_reverse(
    g_h, appearance_forward(1e3 * A, phi_bar, beta)[1]
).d_appearance_coefficients
# Finite far out.
np.testing.assert_allclose(
    saturated,
    definition.appearance_reverse(g_h, (1e3 * A, phi_bar, beta))[0],
    rtol=1e-9,
    atol=1e-290,
)

start = appearance_reverse(
    g_h, appearance_forward(zero, phi_bar, beta)[1]
).d_appearance_coefficients
np.testing.assert_allclose(
    start, beta / Y00 * phi_bar[None, :, None] * g_h[:, None, :], rtol=1e-14
)
assert np.abs(start).max() > 0

# %% [markdown]
# ## The gradient check
#
# The check treats each atom as a separate block, so the other atoms cannot mask a mistake in one of them.

# %%
with one_thread():
    report = check_pair(all_pairs()["appearance"], pair_stream("appearance", 0))
print(table([report]))
assert report.passed

# %% [markdown]
# ## Exercise
#
# 1. Two Gaussians have the same bound $\beta$, but the coefficients $A$ of one are twice those of the other. How do
#    their colour changes compare for small and for large $x$?
# 2. Write `appearance_forward` and `appearance_reverse`, and let the golden cases judge them: `--only appearance`
#    ({doc}`index`). A port that computes $1-\tanh^2x$ from a rounded $\tanh x$ fails the case `deep_saturation`.
# 3. The cell below answers this one. The **argument** $x$ of the residual has mean 0 over the training stamps, because
#    each $\bar\phi_k$ has mean 0. Is the mean of $\beta\tanh x$ also 0? Find an $A$ for which the mean colour over the
#    training stamps changes.

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. No: tanh is not linear. A curve that is high for a short time and slightly low for
# the rest saturates at the top only, so its mean after tanh is negative. The bound limits
# this: the mean changes by less than beta.
bump = np.exp(-(((stamps - 0.5) / 0.05) ** 2))
atoms = np.array([normalised_atoms(t, omega, statistics) for t in stamps])
short = np.zeros((3, 2 * F, 1))
short[:, :, 0] = 12 * np.linalg.lstsq(atoms, bump - bump.mean(), rcond=None)[0]
change = np.array([Y00 * appearance_forward(short, p, beta)[0][0, 0] for p in atoms])
argument = atoms @ short[0, :, 0]
print(f"mean of x: {argument.mean():.1e}, mean change of colour: {change.mean():.3f}")
assert abs(argument.mean()) < 1e-12 and change.mean() < -0.02
