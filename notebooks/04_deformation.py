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
# # 4. The flexible deformation model (FDM)
#
# Tissue deforms while it is filmed, so a Gaussian must move, turn and change its size over time. The base model of
# Endo-TSR does this by ten functions of time, each a sum of $B$ time bases. Every basis has three learned numbers: a
# weight, a centre and a width.
#
# Ten is the number of values that place and shape a Gaussian: the three coordinates of its centre $\mu$, the four of a
# quaternion $q$ for its orientation, and the three logarithms $s$ of its semi-axes ({doc}`06_covariance` explains the
# last two). A time basis is a bell: it acts near its centre and vanishes far from it. The sinusoids of
# {doc}`01_dictionary` act at all times. A pull by an instrument happens once, and a few bells describe it without a
# change at other times.
#
# The equation is {eq}`eq-b1` of {doc}`/specification/b01_deformation`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import deformation as definition
from endotsr.method.equations.deformation import deformation_forward, deformation_reverse
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %%
rng = np.random.default_rng(3)
B, N = 17, 4

# %% [markdown]
# ## The equation
#
# The time $t$ is normalised to $[0,1)$ over the clip. The indices are the channel $c$ (0 to 9), the basis $j$ (1 to
# $B$) and the Gaussian $i$ (1 to $N$). For each of these $10BN$ bells there are a weight $w$, a centre $\theta$ and a
# width $\sigma$. With $\Delta=t-\theta$ and $\Sigma=\sigma^2+10^{-4}$, element by element:
#
# $$
# \psi_{ci}(t)=\sum_{j=1}^{B} w_{cji}\,e_{cji},\qquad
# e=\begin{cases}
# \exp(-u^2),\quad u=\Delta^2/\Sigma & \texttt{quartic}\\[0.5ex]
# \exp\bigl(-\Delta^2/(2\Sigma)\bigr) & \texttt{gaussian}
# \end{cases}
# $$
#
# The constant $10^{-4}$ keeps $\Sigma$ positive, and with it the bell finite, for every $\sigma$. Channels 0-2 belong
# to the position, 3-6 to the quaternion, 7-9 to the log-scale. All are added to the stored values, **before** the
# quaternion is normalised and before the exponential turns a log-scale into a semi-axis:
#
# $$
# \mu(t)=\mu+\psi_{0:3}\;(+\,\Delta\mu),\qquad \tilde q(t)=q+\psi_{3:7},\qquad \log S(t)=s+\psi_{7:10}.
# $$
#
# The term $\Delta\mu$ is the translation of component S, if it is active ({doc}`05_motion_and_prior`).
#
# The form `gaussian` is the textbook bell. The form `quartic` is what the released code of Deform3DGS computes
# ({doc}`/references`): it squares $\Delta^2/\Sigma$ where a Gaussian would halve it. The code gives no reason. The
# preset `paper` follows it.
#
# What the square changes can be computed. Take the distance at which a bell has fallen to one half as its half-width:
# this is $(\ln2)^{1/4}\sqrt\Sigma=0.91\sqrt\Sigma$ for `quartic` and $(2\ln2)^{1/2}\sqrt\Sigma=1.18\sqrt\Sigma$ for
# `gaussian`. A thousandth is reached at $1.62\sqrt\Sigma$ and $3.72\sqrt\Sigma$, which is 1.8 and 3.2 half-widths. For
# the same half-width a quartic bell is flatter at its centre and ends sooner, and fewer weights have a gradient of
# notable size at a frame. The price is the gaps of the next figure. For the same $\sigma$ the two differ much: at $\Delta=0.02$,
# $\sigma=0.01$ they give 0.0183 and 0.3679.
#
# <!-- definition: endotsr.definition.deformation.bell -->
# ```python
# def bell(centre, width, t, basis):
#     """Delta, Sigma and the basis value, (10, B, N) each; a value below 2^-60 is 0.
#
#     Ruling "FDM basis": Deform3DGS squares Delta^2 / Sigma where a Gaussian would halve it. The quartic bell
#     is flatter at its centre and ends sooner, so that a basis acts on a shorter stretch of time.
#     """
#     delta = t - centre
#     sigma = width**2 + 1e-4
#     exponent = (delta**2 / sigma) ** 2 if basis == "quartic" else delta**2 / (2 * sigma)
#     live = exponent.real <= 60 * np.log(2)
#     return delta, sigma, np.where(live, np.exp(-np.where(live, exponent, 0)), 0)
# ```
#
# <!-- definition: endotsr.definition.deformation.deformation_forward -->
# ```python
# def deformation_forward(fdm_weight, fdm_centre, fdm_width, t, basis="quartic"):
#     """Equation (B1): offsets psi (10, N) at normalised time t."""
#     _, _, e = bell(fdm_centre, fdm_width, t, basis)
#     return (fdm_weight * e).sum(axis=1), DeformationSaved(fdm_weight, fdm_centre, fdm_width, t, basis)
# ```

# %%
w = rng.normal(size=(10, B, N))
theta = np.linspace(0, 1, B)[None, :, None] + rng.normal(0, 0.02, (10, B, N))
sigma = rng.uniform(-0.1, 0.1, (10, B, N))  # the sign does not matter: only its square counts
for basis in ("quartic", "gaussian"):
    for t in (0.0, 0.4, 0.93):
        psi, saved = deformation_forward(w, theta, sigma, t, basis)
        text, _ = definition.deformation_forward(w, theta, sigma, t, basis)
        np.testing.assert_allclose(psi, text, rtol=1e-12, atol=1e-15)

for basis, value in (("quartic", 0.0183), ("gaussian", 0.3679)):
    one = np.ones((10, 1, 1))
    found = deformation_forward(one, 0.5 * one, 0.01 * one, 0.52, basis)[0]
    assert abs(found[0, 0] - value) < 1e-4
for basis, reach in (("quartic", 1.6212), ("gaussian", 3.7169)):
    at = reach * np.sqrt(0.05**2 + 1e-4)
    np.testing.assert_allclose(definition.bell(0.0, 0.05, at, basis)[2], 1e-3, rtol=1e-3)
halves = {"quartic": np.log(2) ** 0.25, "gaussian": np.sqrt(2 * np.log(2))}
for basis, half in halves.items():
    at = half * np.sqrt(0.05**2 + 1e-4)
    np.testing.assert_allclose(definition.bell(0.0, 0.05, at, basis)[2], 0.5, rtol=1e-12)
found = [
    halves["quartic"],
    halves["gaussian"],
    1.6212 / halves["quartic"],
    3.7169 / halves["gaussian"],
]
np.testing.assert_allclose(found, [0.91, 1.18, 1.8, 3.2], rtol=0.02)

# %% [markdown]
# ## Figure: which times do the bases cover?
#
# At the start all weights are 0, the centres are evenly spaced and all widths are `model.initial_width`. The gradient
# with respect to a weight at a frame is proportional to $e$, the value of its basis there. With the width 0.01 of the
# preset `paper` there are times at which no basis exceeds 0.001. How many frames of a clip of 63 lie at such times: none,
# a few, or a quarter? These frames add little to the gradients of the weights at first. Training can widen the bases
# later, as step (4.5) below shows. The preset `sharp` starts at the width 0.05 and has no such gaps.

# %% tags=["hide-input"]
fine = np.linspace(0, 1, 1201)
centres = np.linspace(0, 1, B)
figure, axes = plt.subplots(1, 3, figsize=(10.1, 2.9), layout="constrained")
unit = np.zeros((10, B, B))
unit[0] = np.eye(B)  # Gaussian j has basis j alone: the offsets are the values of the bases
spread = np.broadcast_to(centres[None, :, None], unit.shape).copy()
for panel, width in ((axes[0], 0.01), (axes[1], 0.05)):
    values = np.array(
        [deformation_forward(unit, spread, np.full(unit.shape, width), t)[0][0] for t in fine]
    )
    np.testing.assert_allclose(
        values, definition.bell(centres, width, fine[:, None], "quartic")[2], atol=1e-15
    )
    highest = values.max(axis=1)
    panel.plot(fine, values, lw=0.8, color="tab:blue")
    panel.fill_between(fine, 0, 1, where=highest < 1e-3, color="tab:red", alpha=0.25, lw=0)
    panel.set(
        title=f"values of {B} bases, width {width}",
        xlabel="t",
        xlim=(0, 0.5),
        ylim=(-0.03, 1.15),
    )
    assert (highest.min() < 1e-3) == (width == 0.01), "the wider bases leave no gap"
    if width == 0.01:
        frames = np.arange(63) / 63
        assert int((np.interp(frames, fine, highest) < 1e-3).sum()) == 16
        panel.text(0.01, 1.06, "red: no basis above 0.001 (16 of 63 frames)", fontsize=9)
alike = np.sqrt((halves["quartic"] / halves["gaussian"]) ** 2 * (0.01**2 + 1e-4) - 1e-4)
of_gaussian = definition.bell(centres, alike, fine[:, None], "gaussian")[2].max(axis=1)
assert of_gaussian.min() > 0.01, "a gaussian of the same half-width leaves no gap"
learned = rng.normal(0, 1, (10, B, 1))
curve = [
    deformation_forward(learned, spread[:, :, :1].copy(), np.full((10, B, 1), 0.06), t)[0][
        :3, 0
    ]
    for t in fine
]
axes[2].plot(fine, np.array(curve), label=["x", "y", "z"])
axes[2].set(
    title="a trajectory: weights at random, width 0.06",
    xlabel="t",
    ylabel="offset [scene units]",
)
axes[2].legend()
plt.show()

# %% [markdown]
# ## The reverse pass, line by line
#
# We write $g_x$ for the gradient of the loss with respect to $x$; it has the shape of $x$. The stages after this one give
# $g_\psi$ for each channel and Gaussian. We need the gradients with respect to weight, centre, width and time.
#
# **(4.1) The sum.** The sum $\psi=\sum_jw_je_j$ is linear in the weights and in the values of the bases. So $g_w=e\,g_\psi$ and
# $g_e=w\,g_\psi$.
#
# **(4.2) The exponential.** Let $E$ be the exponent, $e=\exp(-E)$. Then $\mathrm de=-e\,\mathrm dE$, and
# $g_E=-e\,g_e$.
#
# **(4.3) The exponent as a function of $\Delta$.** For `quartic`, $E=u^2$ with $u=\Delta^2/\Sigma$. With $\Sigma$ held
# fixed, $\mathrm dE=2u\,\mathrm du=2u\cdot2\Delta/\Sigma\,\mathrm d\Delta$, so $\partial E/\partial\Delta=4\Delta^3/\Sigma^2$. For
# `gaussian`, $E=\Delta^2/(2\Sigma)$ and $\partial E/\partial\Delta=\Delta/\Sigma$.
#
# **(4.4) The exponent as a function of $\sigma$.** From $\Sigma=\sigma^2+10^{-4}$ follows
# $\mathrm d\Sigma=2\sigma\,\mathrm d\sigma$. With $\Delta$ held fixed, $\mathrm du=-u/\Sigma\,\mathrm d\Sigma$. For `quartic`,
# $\partial E/\partial\sigma=2u\cdot(-u/\Sigma)\cdot2\sigma=-4\Delta^4\sigma/\Sigma^3$. For `gaussian`,
# $\partial E/\partial\sigma=-\Delta^2\sigma/\Sigma^2$.
#
# **(4.5) Centre and width.** From $\Delta=t-\theta$ follows $\mathrm d\Delta=-\mathrm d\theta$. This sign cancels the sign of (4.2), so
# $g_\theta=-g_E\,\partial E/\partial\Delta$ has the sign of $w\,g_\psi$ for a basis with its centre before $t$, and the
# opposite sign for one with its centre after $t$. The signs of (4.2) and (4.4) cancel as well: $g_\sigma=g_E\,\partial E/\partial\sigma$. Both `quartic` gradients have the factor $+4$.
#
# **(4.6) Time.** The time $t$ enters every $\Delta$ with the opposite sign of $\theta$: $g_t=-\sum g_\theta$ over all channels, bases
# and Gaussians.
#
# $$
# \begin{aligned}
# g_{w} &= e\,g_\psi,\\
# \texttt{quartic:}\quad g_\theta &= 4we\,\frac{u\,\Delta}{\Sigma}\,g_\psi,\qquad
# g_\sigma = 4we\,\frac{u^2\sigma}{\Sigma}\,g_\psi,\\
# \texttt{gaussian:}\quad g_\theta &= we\,\frac{\Delta}{\Sigma}\,g_\psi,\qquad
# g_\sigma = we\,\frac{\Delta^2\sigma}{\Sigma^2}\,g_\psi,\\
# g_t &= -\sum_{c,j,i} g_{\theta,cji} .
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.deformation.deformation_reverse -->
# ```python
# def deformation_reverse(d_offsets, saved):
#     """Reverse of (B1): from d_offsets (10, N). The kernel computes one exponential for value and derivatives."""
#     w, centre, width, t, basis = saved
#     delta, sigma, e = bell(centre, width, t, basis)
#     d_e = w * d_offsets[:, None]  # (4.1)
#     d_exponent = np.where(e == 0, 0, -d_e * e)  # (4.2)
#     if basis == "quartic":
#         by_delta = 4 * delta**3 / sigma**2  # (4.3)
#         by_width = -4 * delta**4 * width / sigma**3  # (4.4)
#     else:
#         by_delta = delta / sigma  # (4.3)
#         by_width = -(delta**2) * width / sigma**2  # (4.4)
#     d_centre = -d_exponent * by_delta  # (4.5)
#     return DeformationGrads(e * d_offsets[:, None], d_centre, d_exponent * by_width, -d_centre.sum())  # (4.6)
# ```

# %%
g_psi = rng.normal(size=(10, N))
for basis in ("quartic", "gaussian"):
    _, saved = deformation_forward(w, theta, sigma, 0.4, basis)
    grads = deformation_reverse(g_psi, saved)
    texts = definition.deformation_reverse(g_psi, (w, theta, sigma, 0.4, basis))
    for found, text in zip(grads, texts):
        np.testing.assert_allclose(found, text, rtol=1e-10, atol=1e-13)
    reached = np.abs(grads.d_fdm_centre) > 0  # a basis that is not 0 to the last digit
    sign = np.sign(w * (0.4 - theta) * g_psi[:, None, :])
    assert np.array_equal(np.sign(grads.d_fdm_centre)[reached], sign[reached]), "(4.5)"

# %% [markdown]
# Two things follow. While all weights are 0, the gradients with respect to centre and width are exactly 0, so of the three
# only the weights change in the first step. A width of exactly 0 has the gradient 0, whatever the loss, and one that starts
# at 0 never changes: Adam leaves a parameter in place as long as all its gradients are 0 ({doc}`13_optimiser_and_density`).

# %%
_, saved = deformation_forward(np.zeros_like(w), theta, sigma, 0.4)
still = deformation_reverse(g_psi, saved)
assert (
    np.any(still.d_fdm_weight)
    and not np.any(still.d_fdm_centre)
    and not np.any(still.d_fdm_width)
)
for basis in ("quartic", "gaussian"):
    _, saved = deformation_forward(w, theta, 0 * sigma, 0.4, basis)
    assert not np.any(deformation_reverse(g_psi, saved).d_fdm_width)

# %% [markdown]
# ## The gradient check

# %%
with one_thread():
    reports = [
        check_pair(all_pairs()[f"deformation_{b}"], pair_stream(f"deformation_{b}", 0))
        for b in ("quartic", "gaussian")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. Which frames change a basis whose width is 0.01? Use (4.1) to find the distance at which the gradient of its weight
#    has fallen to a thousandth of its maximum.
# 2. Write `deformation_reverse` from (4.1) to (4.6) and let the golden cases judge it, as {doc}`index` describes:
#    `--only deformation`.
# 3. The cell below answers this one. At which distance from the centre of a quartic basis is
#    $|g_\theta|$ largest? Work in $v=\Delta/\sqrt\Sigma$. At which distance is it largest for a `gaussian` basis of equal
#    $\Sigma$?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. Quartic: g_theta ~ exp(-v^4) v^3; the derivative vanishes where 3 v^2 = 4 v^6, v =
# (3/4)^(1/4) = 0.931. Gaussian: g_theta ~ exp(-v^2/2) v, largest at v = 1. So the reach is
# alike; beyond it the quartic basis is much smaller.
v = np.linspace(0, 3, 300_001)
assert abs(v[np.argmax(np.exp(-(v**4)) * v**3)] - 0.75**0.25) < 1e-4
assert abs(v[np.argmax(np.exp(-(v**2) / 2) * v)] - 1) < 1e-4
one = np.ones((10, 1, 2001))
t = 0.5 + np.sqrt(0.05**2 + 1e-4) * np.linspace(0, 2, 2001)
_, saved = deformation_forward(one, 0.5 - (t - 0.5)[None, None, :] * one, 0.05 * one, 0.5)
push = deformation_reverse(np.ones((10, 2001)), saved).d_fdm_centre[0, 0]
assert abs(np.linspace(0, 2, 2001)[np.argmax(push)] - 0.75**0.25) < 1e-3
