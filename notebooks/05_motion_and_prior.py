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
# # 5. The translation residual and its Matérn prior (component S)
#
# Breathing and heartbeat move tissue periodically. Component S therefore adds sinusoids of time to the path of each
# Gaussian. With sixteen free coefficients per axis, their sum can also produce implausible motion between the
# frames. A Matérn-5/2 prior therefore penalises fast motion.
#
# | Symbol | Meaning | Shape in the code |
# |---|---|---|
# | $C_{dki}$ | coefficients: direction $d$, atom $k$, Gaussian $i$; scene units | (3, 2F, N) |
# | $\phi_k(t)$ | raw atoms of {doc}`01_dictionary`; $F$ sines, then $F$ cosines | (2F,) |
# | $\Delta\mu_i(t)$ | translation of Gaussian $i$, scene units | (3, N) |
# | $\ell$ | correlation length of the prior, in normalised time; 0.2 in `paper` | |
# | $\omega_f$ | frequency, cycles per sequence | (F,) |
# | $\rho_f$ | weight of frequency $f$, with mean 1 | (F,) |
# | $\mathcal L_{\mathrm{msp}}$ | the penalty, scene units squared; its weight is $\lambda_{\mathrm{msp}}$, 1 in `paper` | |
#
# The equations are {eq}`eq-3` of {doc}`/specification/03_motion` and {eq}`eq-4` of {doc}`/specification/04_matern`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import matern as definition_of_prior
from endotsr.definition import motion as definition
from endotsr.method.equations.dictionary import (
    atom_statistics,
    dictionary_forward,
    frequencies,
    normalised_atoms,
)
from endotsr.method.equations.matern import (
    matern_penalty_forward,
    matern_penalty_reverse,
    matern_weights,
)
from endotsr.method.equations.motion import motion_forward, motion_reverse
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %%
rng = np.random.default_rng(4)
F, N, length = 8, 150, 0.2
omega = frequencies(F, 1.0, 16.0)
C = rng.normal(0, 0.5, (3, 2 * F, N))

# %% [markdown]
# ## The translation
#
# $$
# \Delta\mu_{di}(t) = \sum_{k=1}^{2F} C_{dki}\,\phi_k(t),\qquad
# \mu_i(t) = \mu_i + \psi_{0:3,i}(t) + \Delta\mu_i(t).
# $$
#
# Here $\mu_i$ is the stored position, and $\psi$ is the offset of the deformation model of {doc}`04_deformation`.
# Unlike the colour residual, the translation uses the **raw** atoms. A shift in time changes the phase of a raw pair
# of sine and cosine, and the penalty below does not depend on this phase. In a normalised pair the sine and the cosine
# have, in general, different scales, and the penalty would depend on the phase.
#
# <!-- definition: endotsr.definition.motion.motion_forward -->
# ```python
# def motion_forward(motion_coefficients, phi):
#     """Equation (3): translation (3, N) = C phi, scene units; phi (2F,) are the raw atoms."""
#     return np.einsum("dkn,k->dn", motion_coefficients, phi), MotionSaved(motion_coefficients, phi)
# ```

# %%
for t in (0.0, 0.37, 0.9):
    phi, _ = dictionary_forward(t, omega)
    translation, saved = motion_forward(C, phi)
    np.testing.assert_allclose(translation, definition.motion_forward(C, phi)[0], rtol=1e-12)

# %% [markdown]
# ## The weights: from a covariance to a spectrum
#
# Let $\tau$ be the difference of two times and $r=|\tau|/\ell$. A Gaussian process with the Matérn-5/2 covariance
# $k(\tau)=\bigl(1+\sqrt5\,r+\tfrac53r^2\bigr)e^{-\sqrt5\,r}$ gives smooth paths. The values of a path at two times
# have the correlation 0.52 if the times differ by $\ell$, and 0.03 if they differ by $3\ell$. By Bochner's theorem the
# covariance is the Fourier transform of a non-negative spectral density, which here is
# $S(\omega)\propto\bigl(5/\ell^2+(2\pi\omega)^2\bigr)^{-3}$. The next cell checks this with a plain sum.

# %%
grid = np.linspace(0, 400, 400_001)
S = (5 / length**2 + (2 * np.pi * grid) ** 2) ** -3
lag = np.linspace(0, 0.8, 9)
from_spectrum = np.array([np.sum(S * np.cos(2 * np.pi * grid * tau)) for tau in lag]) - S[0] / 2
r = lag / length
matern = (1 + np.sqrt(5) * r + 5 / 3 * r**2) * np.exp(-np.sqrt(5) * r)
np.testing.assert_allclose(from_spectrum / from_spectrum[0], matern, atol=1e-9)
at_distance = dict(zip(np.round(r[::2]), matern[::2]))  # every second lag is a multiple of l
print(", ".join(f"{at_distance[k]:.2f} at {k:.0f} l" for k in (1, 2, 3)))
assert [round(at_distance[k], 2) for k in (1, 2, 3)] == [0.52, 0.14, 0.03]

# %% [markdown]
# The penalty follows from this density in four steps.
#
# **(5.1) The prior.** The coefficients are independent normal variables with mean 0. The variance of a coefficient is
# proportional to the spectral density $S(\omega_f)$ at its frequency.
#
# **(5.2) The negative logarithm** of this prior is, up to constants, a sum of the squared coefficients, each divided
# by its variance. The weight of a square is therefore proportional to
# $1/S(\omega_f)\propto\tilde\rho_f=\bigl(5/\ell^2+(2\pi\omega_f)^2\bigr)^3$.
#
# **(5.3) The scale of the weights** is left to the setting $\lambda_{\mathrm{msp}}$. Division by the mean of
# $\tilde\rho$ gives weights of mean 1 for every $\ell$. In this way $\ell$ distributes the penalty over the
# frequencies, and $\lambda_{\mathrm{msp}}$ sets its size.
#
# **(5.4) The mean.** The sum runs over 3 directions, $2F$ atoms and $N$ Gaussians, which are $6NF$ terms. Density
# control changes the number of Gaussians. Division by $6NF$ makes the penalty a mean, which copies of all Gaussians leave
# unchanged. The gradient of a single coefficient has the factor $1/N$.
#
# $$
# \begin{aligned}
# \tilde\rho_f &= \left(\frac{5}{\ell^2} + (2\pi\omega_f)^2\right)^{3},\qquad
# \rho_f = \frac{\tilde\rho_f}{\frac1F\sum_{f'}\tilde\rho_{f'}},\\
# \mathcal L_{\mathrm{msp}} &= \frac{1}{6NF}\sum_{i=1}^{N}\sum_{f=1}^{F}\rho_f\sum_{d=1}^{3}\left(C_{d,f,i}^2 + C_{d,F+f,i}^2\right).
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.matern.matern_weights -->
# ```python
# def matern_weights(omega, length):
#     """Equation (4), upper line: rho (F,), mean 1, for frequencies (F,) > 0 and the correlation length >= 0, as printed.
#
#     The kernel first divides by the largest frequency, which avoids overflow. At 1e-40 every rho rounds to 1 already.
#     """
#     rho = (5 / max(length, 1e-40) ** 2 + (2 * np.pi * omega) ** 2) ** 3  # (5.2)
#     return rho / rho.mean()  # (5.3)
# ```
#
# <!-- definition: endotsr.definition.matern.matern_penalty_forward -->
# ```python
# def matern_penalty_forward(motion_coefficients, rho):
#     """Equation (4), lower line: scene units squared; both atoms of a frequency share its weight."""
#     n = motion_coefficients.shape[2]
#     squares = np.einsum("dkn,dkn->k", motion_coefficients, motion_coefficients)
#     return np.tile(rho, 2) @ squares / (6 * max(n, 1) * rho.size), MaternSaved(motion_coefficients, rho)  # (5.4)
# ```

# %%
rho = matern_weights(omega, length)
np.testing.assert_allclose(rho, definition_of_prior.matern_weights(omega, length), rtol=1e-14)
for ell in (0.001, 0.01, 0.02, 0.05, 1.0):  # the stable form has two branches
    text = definition_of_prior.matern_weights(omega, ell)
    np.testing.assert_allclose(matern_weights(omega, ell), text, rtol=1e-13)
print("rho:", " ".join(f"{value:.3g}" for value in rho))
penalty, saved_penalty = matern_penalty_forward(C, rho)
text, _ = definition_of_prior.matern_penalty_forward(C, rho)
np.testing.assert_allclose(penalty, text, rtol=1e-13)
copies = matern_penalty_forward(np.tile(C, 2), rho)[0]
np.testing.assert_allclose(copies, penalty, rtol=1e-13)  # (5.4)

# %% [markdown]
# **The implied covariance differs.** The weights are those of a Matérn spectrum, but eight log-spaced frequencies do
# not form a uniform grid. If the coefficients are independent with variances $\propto 1/\rho_f$, the path has the
# covariance $\sum_f\rho_f^{-1}\cos 2\pi\omega_f\tau$. This is not a Matérn covariance: its correlation at $\tau=\ell$
# is 0.02 instead of 0.52, and it does not decay as $\tau$ grows. The penalty only defines the relative cost of the
# frequencies.

# %%
implied = lambda tau: np.sum(np.cos(2 * np.pi * omega * tau) / rho) / np.sum(1 / rho)
print(f"correlation at l: {implied(length):.2f} implied, {at_distance[1]:.2f} Matérn")
assert round(implied(length), 2) == 0.02
assert max(abs(implied(tau)) for tau in np.linspace(0.6, 1.0, 81)) > 0.3, "three to five l"

# %% [markdown]
# **The Student-t identity.** Up to a constant factor, $S(\omega)$ is the density of a Student-t variable with 5
# degrees of freedom and scale $1/\ell$, evaluated at $2\pi\omega$. Such a variable is a normal variable whose
# precision is random, with a gamma distribution of shape and rate $5/2$. An integral over the precision gives the same
# weights without the formula of $S$:

# %%
precision = np.exp(np.linspace(-30, 5, 2001))  # equal steps of its logarithm
gamma = precision ** (5 / 2) * np.exp(-5 / 2 * precision)
normal = np.sqrt(precision) * np.exp(
    -precision * (2 * np.pi * omega * length)[:, None] ** 2 / 2
)
density = (gamma * normal).sum(axis=1)  # up to a constant factor
np.testing.assert_allclose(rho, (1 / density) / np.mean(1 / density), rtol=1e-13)

# %% [markdown]
# **Invariance to phase.** If the coefficients of the sine and the cosine of one frequency are rotated by an angle
# $\theta$, this component of the path shifts in time by $\theta/(2\pi\omega_f)$. The path as a whole shifts only if
# all pairs are shifted by the same time. In both cases the penalty is unchanged.


# %%
def turned(C, turn):
    """Every pair of C rotated by its angle."""
    sine, cosine = C[:, :F], C[:, F:]
    first = np.cos(turn) * sine - np.sin(turn) * cosine
    return np.concatenate([first, np.sin(turn) * sine + np.cos(turn) * cosine], axis=1)


turn = rng.uniform(0, 2 * np.pi, (3, F, N))
np.testing.assert_allclose(matern_penalty_forward(turned(C, turn), rho)[0], penalty, rtol=1e-13)

path_at = lambda C, t: motion_forward(C, dictionary_forward(t, omega)[0])[0]
shift, t, f = 0.07, 0.31, 3
theta = (2 * np.pi * omega * shift)[None, :, None]
np.testing.assert_allclose(path_at(turned(C, theta), t), path_at(C, t + shift), atol=1e-12)
alone = np.zeros_like(C)
alone[:, [f, F + f]] = C[:, [f, F + f]]
same = np.broadcast_to(1.2, (1, F, 1))  # one angle for all pairs is not one time for all
at = t + 1.2 / (2 * np.pi * omega[f])
np.testing.assert_allclose(path_at(turned(alone, same), t), path_at(alone, at), atol=1e-12)
assert np.abs(path_at(turned(C, same), t) - path_at(C, at)).max() > 0.1

# Normalised atoms: the same rotation of a pair is no shift in time.
statistics = atom_statistics(np.delete(np.arange(20), [1, 9, 17]) / 20, omega)
normalised = lambda C, t: motion_forward(C, normalised_atoms(t, omega, statistics))[0]
difference = normalised(turned(C, theta), t) - normalised(C, t + shift)
assert np.ptp(difference - normalised(turned(C, theta), 0.5) + normalised(C, 0.57)) > 0.1

# %% [markdown]
# ## Figure: the effect of the penalty on a trajectory
#
# A point moves on a smooth path. It is observed with a little noise in the training frames of a short clip, which give
# 17 stamps for 16 coefficients. With almost as many unknowns as observations, many sums fit the stamps about equally
# well and differ between them. The sum of sinusoids is fitted twice: by least squares alone, and with
# $\lambda_{\mathrm{msp}}\,\mathcal L_{\mathrm{msp}}$ added. In each case the minimum of a quadratic is the solution of
# one linear system; the reverse pass below gives the part of its matrix that belongs to the penalty. The left panel
# shows both paths, the middle panel the energy of their coefficients, and the right panel the weights for several values
# of $\ell$. Where will the two fits differ more, at the stamps or between them?

# %% tags=["hide-input"]
stamps = np.delete(np.arange(20), np.arange(1, 20, 8)) / 20
fine = np.linspace(stamps[0], stamps[-1], 501)
path = lambda t: 1.5 * np.sin(2 * np.pi * 1.2 * t) + 0.7 * np.cos(2 * np.pi * 2.3 * t + 1)
seen = path(stamps) + np.random.default_rng(1).normal(0, 0.1, stamps.size)
Phi = np.array([dictionary_forward(t, omega)[0] for t in stamps])
Phi_fine = np.array([dictionary_forward(t, omega)[0] for t in fine])


def fit(weight):
    """Minimise mean((Phi c - seen)^2) + weight L_msp(c) for one Gaussian that moves along x."""
    columns = []
    # The penalty's gradient is linear in C: its columns are the gradients of unit vectors.
    for k in range(2 * F):
        unit = np.zeros((3, 2 * F, 1))
        unit[0, k, 0] = 1
        columns.append(
            matern_penalty_reverse(weight, matern_penalty_forward(unit, rho)[1])[0, :, 0]
        )
    system = 2 / len(stamps) * Phi.T @ Phi + np.array(columns)
    return np.linalg.solve(system, 2 / len(stamps) * Phi.T @ seen)


free, held = fit(0.0), fit(1.0)
error = lambda c: np.sqrt(np.mean((Phi_fine @ c - path(fine)) ** 2))
print(
    f"error over all times: {error(free):.2f} without the prior, {error(held):.2f} with it; "
    "noise 0.10"
)
assert error(held) < 0.6 * error(free)
misses = lambda c: np.sqrt(np.mean((Phi @ c - seen) ** 2))
print(f"error at the stamps: {misses(free):.3f} without the prior, {misses(held):.3f} with it")
assert misses(held) < 1.2 * misses(free), "about equal at the stamps"
apart = [np.sqrt(np.mean((some @ (free - held)) ** 2)) for some in (Phi, Phi_fine)]
print(f"distance of the two fits: {apart[0]:.2f} at the stamps, {apart[1]:.2f} over all times")
assert apart[1] > 2 * apart[0], "they differ between the stamps"

figure, axes = plt.subplots(1, 3, figsize=(10.1, 3.1), layout="constrained")
axes[0].plot(fine, path(fine), color="0.5", lw=4, label="true path")
axes[0].plot(fine, Phi_fine @ free, color="tab:red", lw=1.2, label="no prior")
axes[0].plot(
    fine, Phi_fine @ held, color="tab:blue", lw=1.5, label="with $\\mathcal{L}_{\\rm msp}$"
)
axes[0].plot(stamps, seen, "k.", ms=4)
axes[0].set(title="a trajectory", xlabel="t", ylabel="x [scene units]", ylim=(-2.6, 3.4))
axes[0].legend(loc="upper right", ncols=2)
energy = lambda c: c[:F] ** 2 + c[F:] ** 2
axes[1].loglog(omega, energy(free), "o-", color="tab:red", label="no prior")
axes[1].loglog(omega, energy(held), "o-", color="tab:blue", label="with prior")
axes[1].loglog(omega, 2 * rho[0] / rho, "k:", label="$\\propto 1/\\rho$")
axes[1].set(
    title="energy of the coefficients",
    xlabel="$\\omega$ [cycles per sequence]",
    ylim=(1e-7, 30),
)
axes[1].legend()
for ell in (0.0, 0.05, 0.1, 0.2, np.inf):
    axes[2].loglog(omega, matern_weights(omega, ell), "o-", ms=4, label=f"$\\ell=${ell:g}")
axes[2].set(
    title="weights $\\rho_f$", xlabel="$\\omega$ [cycles per sequence]", ylim=(1e-7, 20)
)
axes[2].legend()
plt.show()

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_{\Delta\mu}$ is given for each direction and Gaussian, and we need the gradients with respect to the
# coefficients $C$ and to the atoms $\phi$. The translation is bilinear in the two, like the argument of the colour
# residual in (2.5) and (2.6).
#
# **(5.5) One coefficient** is multiplied by one atom, so $g_{C_{dki}}=g_{\Delta\mu_{di}}\,\phi_k$.
#
# **(5.6) One atom** is multiplied by the coefficients of all Gaussians and directions, so its gradient is a sum over
# both.
#
# $$
# g_{C_{dki}} = g_{\Delta\mu_{di}}\,\phi_k,\qquad
# g_{\phi_k} = \sum_{i=1}^{N}\sum_{d=1}^{3} g_{\Delta\mu_{di}}\,C_{dki} .
# $$
#
# **(5.7) The penalty.** The weights $\rho$ depend on the settings only and are held fixed. With
# $\mathrm dC^2=2C\,\mathrm dC$, the factor $1/(6NF)$ of the sum becomes $2/(6NF)=1/(3NF)$.
#
# $$
# g_{C_{d,f,i}} = \frac{\rho_f}{3NF}\,C_{d,f,i}\;g_{\mathcal L_{\mathrm{msp}}},\qquad
# g_{C_{d,F+f,i}} = \frac{\rho_f}{3NF}\,C_{d,F+f,i}\;g_{\mathcal L_{\mathrm{msp}}} .
# $$
#
# <!-- definition: endotsr.definition.motion.motion_reverse -->
# ```python
# def motion_reverse(d_translation, saved):
#     """Reverse of (3)."""
#     c, phi = saved
#     return MotionGrads(d_translation[:, None] * phi[:, None], np.einsum("dn,dkn->k", d_translation, c))  # (5.5), (5.6)
# ```
#
# <!-- definition: endotsr.definition.matern.matern_penalty_reverse -->
# ```python
# def matern_penalty_reverse(d_penalty, saved):
#     """Reverse of (4): d_motion_coefficients (3, 2F, N); rho is held fixed."""
#     c, rho = saved
#     return d_penalty * np.tile(rho, 2)[:, None] * c / (3 * max(c.shape[2], 1) * rho.size)  # (5.7)
# ```

# %%
g = rng.normal(size=(3, N))
for found, text in zip(motion_reverse(g, saved), definition.motion_reverse(g, (C, phi))):
    np.testing.assert_allclose(found, text, rtol=1e-11)
text = definition_of_prior.matern_penalty_reverse(0.7, (C, rho))
np.testing.assert_allclose(matern_penalty_reverse(0.7, saved_penalty), text, rtol=1e-13)

# %% [markdown]
# ## Interactive figure: correlation length and penalty
#
# The curve is a trajectory fitted to noisy frames. It minimises the mean squared error plus
# $\lambda_{\mathrm{msp}}\mathcal L_{\mathrm{msp}}$ of {eq}`eq-4`. Before you move a slider, predict what is left of the
# curve at the largest weight: a straight line, the slow wave, or the beat?
#
# <div class="widget" data-widget="matern">The figure is live in the built book.</div>

# %% [markdown]
# ## The gradient check
#
# The weights span five decades, and the gradient is small by construction: with 30 000 Gaussians its factors
# $\rho_f/(3NF)$ are $4\cdot10^{-11}$ to $10^{-5}$. A check with an absolute tolerance, or with one norm over all
# entries, would accept a wrong weight of a low frequency. This check is relative and treats each atom separately.

# %%
np.testing.assert_allclose(rho[[0, -1]] / (3 * 30_000 * F), [4e-11, 1e-5], rtol=0.05)
with one_thread():
    reports = [
        check_pair(all_pairs()[name], pair_stream(name, 0))
        for name in ("motion", "matern_penalty")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. The correlation length is doubled, and the weights keep their mean of 1. How do the weights of the slowest and of
#    the fastest frequency change?
# 2. Write the pair of the penalty {eq}`eq-4` and let the golden cases judge it: `--only matern`. Then write the pair of
#    {eq}`eq-3`: `--only motion` ({doc}`index`).
# 3. The cell below answers this one. Raw atoms whose frequency is no whole number have a mean over the clip that is not
#    0, so $C$ can contain a constant offset of the position. The canonical position could represent this offset at no
#    cost. Does the penalty allow it in $C$? Then fit a slow drift $x=t$ with the atoms. How does its penalty compare
#    with that of an oscillation of the same size at 16 cycles?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The penalty allows the offset at a cost, and the canonical position represents it at
# none. The four lowest frequencies represent most of a drift. Their weights are 3e-5 to 1e-3,
# and the lowest ones have the largest coefficients, so a drift costs tens of thousands of times
# less than a wiggle.
cost = lambda c: matern_penalty_forward(np.stack([c, 0 * c, 0 * c])[:, :, None], rho)[0]
Phi_all = np.array([dictionary_forward(t, omega)[0] for t in np.arange(63) / 63])
low = np.r_[:4, F : F + 4]
drift = np.zeros(2 * F)
drift[low] = np.linalg.lstsq(Phi_all[:, low], np.arange(63) / 63 - 0.5, rcond=None)[0]
wiggle = np.zeros(2 * F)
wiggle[F - 1] = 0.5
print(f"drift {cost(drift):.1e}, wiggle {cost(wiggle):.1e}")
assert cost(drift) < 1e-4 * cost(wiggle)
assert (np.diff(np.hypot(drift[:F], drift[F:])[:4]) < 0).all(), "the lowest has the largest"
assert np.std(Phi_all @ drift - np.arange(63) / 63 + 0.5) < 0.05 * np.std(np.arange(63) / 63)
