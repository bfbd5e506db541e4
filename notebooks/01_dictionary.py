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
# # 1. Time: the Fourier dictionary and its normalised atoms
#
# During a clip the light drifts, and breathing and heartbeat move the tissue. Endo-TSR describes these changes with
# two residuals, one of the colour and one of the position of each Gaussian. Both are weighted sums of the same $2F$
# sinusoids of time, which are called *atoms*. This chapter constructs the atoms, and then centres and scales them over
# the training stamps. It also treats the one case in which an atom must not be scaled: an atom that is constant
# over the stamps.
#
# | Symbol | Meaning | In `paper` |
# |---|---|---|
# | $t$ | normalised time: the index of a frame divided by the number of frames of the clip | |
# | $F$ | number of frequencies | 8 |
# | $\omega_f$ | frequency $f$, in cycles per sequence; $\omega_{\min}$, $\omega_{\max}$ are the smallest and the largest | 1 to 16 |
# | $\phi_k(t)$ | the $2F$ *atoms*: a sine and a cosine of each frequency | 16 atoms |
# | $\mathcal T$, $n$ | the training stamps, which are the distinct times of the training frames, and their number | |
# | $m_k$, $\rho^{\mathrm{rms}}_k$ | mean and root mean square deviation (RMS) of atom $k$ over $\mathcal T$ | |
# | $\bar\phi_k(t)$ | the *normalised* atoms, with mean 0 and RMS 1 over $\mathcal T$ unless they are dead | |
#
# The equations are {eq}`eq-1` and {eq}`eq-1b` of {doc}`/specification/01_dictionary`. In the book such references are
# links.
#
# A chapter with equations prints them as the specification prints them, followed by their **definition** in plain NumPy
# where they have one. An `assert` then compares the definition with the compiled function. If the two differ there, the
# chapter stops with an error.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np
from running_clip import load

from endotsr.definition import dictionary as definition
from endotsr.method.equations.dictionary import (
    atom_statistics,
    dictionary_forward,
    dictionary_reverse,
    frequencies,
    normalise_forward,
    normalise_reverse,
    report_atoms,
)
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %% [markdown]
# ## The dictionary
#
# The frequencies are measured in cycles per sequence. They are spaced logarithmically between the smallest and the
# largest:
#
# $$
# \omega_f = \omega_{\min}\left(\frac{\omega_{\max}}{\omega_{\min}}\right)^{\frac{f-1}{F-1}},\qquad f = 1,\dots,F .
# $$
#
# The first $F$ atoms are the sines of these frequencies, and the other $F$ are the cosines:
#
# $$
# \phi_f(t) = \sin(2\pi\omega_f t),\qquad \phi_{F+f}(t) = \cos(2\pi\omega_f t),\qquad f=1,\dots,F .
# $$
#
# <!-- definition: endotsr.definition.dictionary.frequencies -->
# ```python
# def frequencies(count, low, high):
#     """Equation (1): omega (F,), cycles per sequence, log-spaced with exact end points."""
#     omega = low * (high / low) ** (np.arange(count) / max(count - 1, 1))
#     omega[1:][-1:] = high
#     return omega
# ```
#
# <!-- definition: endotsr.definition.dictionary.dictionary_forward -->
# ```python
# def dictionary_forward(t, omega):
#     """Equation (1): phi (2F,), all sines, then all cosines, at normalised time t.
#
#     Quarter turns are removed first: a sine of 1e-16 instead of 0 would give C a gradient, and Adam would move it.
#     """
#     turns = omega * t
#     quarters = np.rint(4 * turns.real)
#     angle = 2 * np.pi * (turns - quarters / 4)  # (1.2)
#     which = quarters.astype(np.intp) % 4  # an index has the width of a pointer
#     s, c = np.sin(angle), np.cos(angle)
#     sine = np.choose(which, [s, c, -s, -c])
#     cosine = np.choose(which, [c, -s, -c, s])
#     phi = np.concatenate([sine, cosine])
#     return phi, DictionarySaved(t, omega)
# ```

# %% [markdown]
# The compiled functions have the same names as those of the definition and agree with them to rounding.

# %%
F, omega_min, omega_max = 8, 1.0, 16.0
m = load().config.model
assert (m.frequencies, m.frequency_min, m.frequency_max) == (F, omega_min, omega_max)
omega = frequencies(F, omega_min, omega_max)
np.testing.assert_allclose(omega, definition.frequencies(F, omega_min, omega_max), rtol=1e-14)
assert omega[0] == 1.0 and omega[-1] == 16.0, "the end points are set, not computed"

for t in (0.0, 0.137, 0.37, 0.81, -0.4, 1.9):
    phi, _ = dictionary_forward(t, omega)
    np.testing.assert_allclose(phi, definition.dictionary_forward(t, omega)[0], atol=1e-15)

# %% [markdown]
# ### Why the phase is reduced first
#
# The argument of $\sin(2\pi\cdot16\cdot\tfrac{5}{32})$ is five half turns, where the sine is exactly 0. A
# floating-point number cannot represent $\pi$ exactly, so the formula as printed gives rounding noise instead. The
# specification therefore removes whole turns and quarter turns **before** the multiplication by $\pi$. Both
# subtractions are exact. With $p=\omega t$, $r = p - \operatorname{round}(p)$, $k=\operatorname{round}(4r)$ and
# $\delta = r - k/4$:
#
# $$
# (\sin 2\pi p,\ \cos 2\pi p) =
# \begin{cases}
# (\phantom{-}\sin 2\pi\delta,\ \phantom{-}\cos 2\pi\delta) & k \equiv 0 \\
# (\phantom{-}\cos 2\pi\delta,\ -\sin 2\pi\delta) & k \equiv 1 \\
# (-\sin 2\pi\delta,\ -\cos 2\pi\delta) & k \equiv 2 \\
# (-\cos 2\pi\delta,\ \phantom{-}\sin 2\pi\delta) & k \equiv 3
# \end{cases}
# \pmod 4 .
# $$

# %%
as_printed = lambda t: np.sin(2 * np.pi * omega * t)
phi, _ = dictionary_forward(5 / 32, omega)
print("as printed:", as_printed(5 / 32)[F - 1], "  folded:", phi[F - 1])
assert phi[F - 1] == 0.0 and as_printed(5 / 32)[F - 1] != 0.0
rng = np.random.default_rng(1)
for t in rng.uniform(0, 1, 20):
    np.testing.assert_allclose(dictionary_forward(t, omega)[0][:F], as_printed(t), atol=1e-13)

# %% [markdown]
# ## Centred and scaled over the training stamps
#
# The base colour of a Gaussian should represent its mean colour, and the colour residual should represent the
# deviations from that mean. The atoms of the colour residual therefore have mean 0 over the training stamps
# $\mathcal T$. They also have RMS 1, so that equal coefficients contribute equally, in RMS, to the weighted sum of the
# atoms:
#
# $$
# \begin{aligned}
# m_k &= \frac1n\sum_{t\in\mathcal T}\phi_k(t),\qquad
# \rho^{\mathrm{rms}}_k = \sqrt{\frac1n\sum_{t\in\mathcal T}\bigl(\phi_k(t)-m_k\bigr)^2},\\
# \bar\phi_k(t) &= \begin{cases} \dfrac{\phi_k(t)-m_k}{\rho^{\mathrm{rms}}_k} & \rho^{\mathrm{rms}}_k \ge 10^{-6}\\[2ex] 0 & \text{otherwise (dead)} \end{cases}
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.dictionary.atom_statistics -->
# ```python
# def atom_statistics(times, omega):
#     """Equation (1b): population statistics (divisor n) over the distinct training stamps `times` (n,)."""
#     atoms = np.array([dictionary_forward(t, omega)[0] for t in np.unique(times)])
#     mean = atoms.mean(axis=0)
#     rms = np.sqrt(((atoms - mean) ** 2).mean(axis=0))
#     return AtomStatistics(mean, rms, rms < 1e-6)  # ruling "atom statistics": an atom that is constant up to rounding
# ```
#
# <!-- definition: endotsr.definition.dictionary.normalise_forward -->
# ```python
# def normalise_forward(phi, statistics):
#     """Equation (1b): phi_bar (2F,); a dead atom is 0."""
#     live_rms = np.where(statistics.dead, np.inf, statistics.rms)
#     return (phi - statistics.mean) / live_rms, statistics
# ```

# %%
stamps = np.delete(np.arange(24), [1, 9, 17]) / 24  # 24 frames, every eighth is held out
statistics = atom_statistics(stamps, omega)
for t in (0.0, 0.31, 0.77):
    phi, _ = dictionary_forward(t, omega)
    phi_bar, saved_bar = normalise_forward(phi, statistics)
    text = definition.normalised_atoms(t, omega, definition.atom_statistics(stamps, omega))
    np.testing.assert_allclose(phi_bar, text, atol=1e-12)

bars = np.array(
    [normalise_forward(dictionary_forward(t, omega)[0], statistics)[0] for t in stamps]
)
np.testing.assert_allclose(bars.mean(axis=0), 0, atol=1e-14)
np.testing.assert_allclose((bars**2).mean(axis=0), 1, rtol=1e-12)

# %% [markdown]
# ### Figure: a Gaussian of the running clip
#
# The running clip of this book has 63 frames, of which every eighth is held out. The left panel shows the colour
# residual of one Gaussian that was trained on this clip, the one in the stored extract whose colour changes most. Its
# residual is $\beta\tanh(A\bar\phi(t))$ with its coefficients $A$ and $\beta=0.3$ ({doc}`02_colour_residual`). If the
# same coefficients multiplied the raw atoms $\phi(t)$, the mean of $A\phi(t)$ over the training stamps would not be 0.
# By how many of the 255 levels would the mean colour of a Gaussian then shift?

# %% tags=["hide-input"]
clip = load()
A, beta = clip.gaussians.appearance_coefficients.astype(np.float64), clip.config.model.beta
both = [dictionary_forward(t, clip.spectral.omega)[0] for t in clip.train_times]
both = (
    np.array(both),
    np.array([normalise_forward(p, clip.spectral.statistics)[0] for p in both]),
)
on_raw, on_bar = (255 * beta * np.tanh(np.einsum("cfn,tf->tcn", A, atoms)) for atoms in both)
shift_raw, shift_bar = np.abs(on_raw.mean(axis=0)), np.abs(on_bar.mean(axis=0))
strong = int(np.argmax(np.sqrt((on_bar**2).mean(axis=(0, 1)))))
curve = np.linspace(0, 1, 400)
on_curve = [dictionary_forward(t, clip.spectral.omega)[0] for t in curve]
curve_bar = [normalise_forward(p, clip.spectral.statistics)[0] for p in on_curve]
figure, axes = plt.subplots(
    1, 2, figsize=(10.1, 3.1), layout="constrained", width_ratios=[1.5, 1]
)
for channel, colour in enumerate(("#D55E00", "#009E73", "#0072B2")):
    line = 255 * beta * np.tanh(np.array(curve_bar) @ A[channel, :, strong])
    axes[0].plot(curve, line, color=colour, lw=1.2, label=("red", "green", "blue")[channel])
    axes[0].plot(clip.train_times, on_bar[:, channel, strong], ".", color=colour, ms=5)
axes[0].axhline(0, color="0.5", lw=0.8)
axes[0].axvline(clip.time, color="0.5", ls=":", lw=1)
axes[0].set(title="one Gaussian: its colour residual, 1/255", xlabel="t")
axes[0].legend(ncols=3)
bins = np.linspace(0, shift_raw.max(), 30)
axes[1].hist(shift_raw.ravel(), bins, color="0.7", label="raw atoms")
axes[1].hist(shift_bar.ravel(), bins, color="#0072B2", alpha=0.7, label="normalised atoms")
axes[1].set(
    title=f"{A.shape[2]} Gaussians: shift of the mean colour", xlabel="1/255", ylabel="number"
)
axes[1].legend()
plt.show()
print(f"raw: up to {shift_raw.max():.1f}, mean {shift_raw.mean():.2f} of 255 levels")
print(f"normalised: up to {shift_bar.max():.1f}, mean {shift_bar.mean():.2f}")
assert shift_bar.mean() < 0.1 * shift_raw.mean() and 0.3 < shift_raw.mean() < 0.4
np.testing.assert_allclose(np.einsum("cfn,tf->tcn", A, both[1]).mean(axis=0), 0, atol=1e-6)
offset = np.sqrt((both[0].mean(axis=0) ** 2).mean()) / both[0].std(axis=0).mean()
assert 0.07 < offset < 0.15, "about a tenth"

# %% [markdown]
# With raw atoms the mean colour shifts by about a third of a level on average. The shift is small, as is the mean of a
# raw atom: over the 55 training stamps it is about a tenth of the deviation of that atom. With normalised atoms the
# argument of the $\tanh$ has mean 0, so the shift that remains comes from the $\tanh$. The next section shows the case
# in which an atom cannot be scaled.
#
# ## The dead atom
#
# Consider a clip of 32 frames. At its stamps $t=k/32$ the sine of 16 cycles is $\sin(\pi k)=0$. Between the frames
# this atom differs from 0, but on the frames it is 0 up to rounding noise, and so is its RMS. If the noise were
# divided by its own RMS, the atom would become a random signal of size 1, and the model would be trained on it. Such
# an atom is called *dead*, and so is one with another constant value: at $t=k/16$ the cosine of 16 cycles is 1. The
# rule is therefore: if the RMS is below $10^{-6}$, the atom is set to 0, and so is its
# gradient.

# %%
stamps_32 = np.arange(32) / 32
statistics_32 = atom_statistics(stamps_32, omega)
assert np.flatnonzero(statistics_32.dead).tolist() == [F - 1]
assert np.flatnonzero(atom_statistics(np.arange(16) / 16, omega).dead).tolist() == [
    F - 1,
    2 * F - 1,
]
print(report_atoms(stamps_32, omega))

naive = np.array([np.sin(2 * np.pi * 16.0 * t) for t in stamps_32])
# What a division without the rule makes of rounding noise.
resurrected = (naive - naive.mean()) / naive.std()
right = [
    normalise_forward(dictionary_forward(t, omega)[0], statistics_32)[0][F - 1]
    for t in stamps_32
]
assert np.abs(resurrected).max() > 1 and not np.any(right)

# %% tags=["hide-input"]
fine = np.linspace(0, 1, 801)
raw = np.array([dictionary_forward(t, omega)[0] for t in fine])
bar = np.array([normalise_forward(p, statistics)[0] for p in raw])
figure, axes = plt.subplots(1, 3, figsize=(10.1, 3.1), layout="constrained")
shown = (
    (F, "cos, 1 cycle", "tab:blue"),
    (1, "sin, 1.5 cycles", "tab:red"),
    (3, "sin, 3.3 cycles", "tab:green"),
)
for panel, values, title in (
    (axes[0], raw, "raw atoms $\\phi_k(t)$"),
    (axes[1], bar, "normalised atoms $\\bar\\phi_k(t)$"),
):
    for k, label, colour in shown:
        panel.plot(fine, values[:, k], color=colour, lw=1.2, label=label)
        panel.plot(stamps, np.interp(stamps, fine, values[:, k]), ".", color=colour, ms=6)
        on_frames = np.interp(stamps, fine, values[:, k]).mean()
        panel.axhline(on_frames, color=colour, ls=":", lw=1)
    panel.set(title=title, xlabel="t")
    panel.set_ylim(-2.8, 1.7)
axes[0].legend(loc="lower left", fontsize=8)
axes[1].text(
    0.02,
    0.03,
    "dots: training stamps\ndotted: their mean",
    transform=axes[1].transAxes,
    fontsize=9,
)
axes[2].plot(fine, np.sin(2 * np.pi * 16 * fine), color="0.75", lw=0.8, label="sin, 16 cycles")
axes[2].plot(stamps_32, resurrected, "x", color="tab:red", label="divided by its noise")
axes[2].plot(stamps_32, right, "o", color="tab:green", ms=4, label="endotsr: dead, exactly 0")
axes[2].set(title="the dead atom, 32 frames", xlabel="t")
axes[2].set_ylim(-3.2, 3.2)
axes[2].legend(loc="lower left")
plt.show()

# %% [markdown]
# ## The reverse pass, line by line
#
# Throughout the book $g_X$ denotes $\partial\mathcal L/\partial X$, the gradient of the loss $\mathcal L$ with respect
# to $X$. Here $g_\phi$ is given for each atom, and we need the gradients with respect to the frequencies and to time.
#
# **(1.1) The phase.** Time and frequency enter an atom through the number of turns $p_f=\omega_ft$, whose differential
# is $\mathrm dp_f=t\,\mathrm d\omega_f+\omega_f\,\mathrm dt$.
#
# **(1.2) The angle.** The folding subtracts whole turns and quarter turns from $p_f$. Between two jumps the subtracted
# number is constant, so $\mathrm d\delta=\mathrm dp_f$. A change of the phase by $\mathrm dp_f$ therefore changes the
# angle by $2\pi\,\mathrm dp_f$.
#
# **(1.3) Sine and cosine.** Let $s_f$ and $c_f$ be the sine and the cosine of frequency $f$. Then
# $\mathrm d\phi_f=2\pi c_f\,\mathrm dp_f$ and $\mathrm d\phi_{F+f}=-2\pi s_f\,\mathrm dp_f$. Both atoms depend on the
# same phase, so its gradient is the sum of two terms: $g_{p_f}=2\pi\,(g_{\phi_f}c_f-g_{\phi_{F+f}}s_f)$.
#
# **(1.4) Frequency and time.** By (1.1) a frequency changes its own phase and no other, which gives
# $g_{\omega_f}=t\,g_{p_f}$. Time changes all $F$ phases, which gives $g_t=\sum_f\omega_f\,g_{p_f}$.
#
# $$
# g_{\omega_f} = 2\pi t\,\bigl(g_{\phi_f}\,c_f - g_{\phi_{F+f}}\,s_f\bigr),\qquad
# g_t = \sum_{f=1}^{F} 2\pi\omega_f\,\bigl(g_{\phi_f}\,c_f - g_{\phi_{F+f}}\,s_f\bigr).
# $$
#
# **(1.5) The scale.** The statistics $m_k$ and $\rho^{\mathrm{rms}}_k$ are computed once from the training stamps and
# then held fixed, so $\mathrm d\bar\phi_k=\mathrm d\phi_k/\rho^{\mathrm{rms}}_k$.
#
# **(1.6) The dead atom.** A dead atom is 0 at every time, whatever the value of $\phi_k$, so its gradient is 0.
#
# $$
# g_{\phi_k} = \begin{cases} g_{\bar\phi_k}/\rho^{\mathrm{rms}}_k & \text{alive}\\ 0 & \text{dead} \end{cases}
# $$
#
# <!-- definition: endotsr.definition.dictionary.dictionary_reverse -->
# ```python
# def dictionary_reverse(d_phi, saved):
#     """Reverse of (1): from d_phi (2F,)."""
#     sine, cosine = np.split(dictionary_forward(*saved)[0], 2)
#     d_sine, d_cosine = np.split(d_phi, 2)
#     d_turns = 2 * np.pi * (d_sine * cosine - d_cosine * sine)  # (1.2), (1.3)
#     return DictionaryGrads((d_turns * saved.omega).sum(), d_turns * saved.t)  # (1.1), (1.4)
# ```
#
# <!-- definition: endotsr.definition.dictionary.normalise_reverse -->
# ```python
# def normalise_reverse(d_phi_bar, saved):
#     """Reverse of (1b): the statistics are held fixed."""
#     return d_phi_bar / np.where(saved.dead, np.inf, saved.rms)  # (1.5), (1.6)
# ```

# %%
g_phi = rng.normal(size=2 * F)
_, saved = dictionary_forward(0.37, omega)
grads = dictionary_reverse(g_phi, saved)
text = definition.dictionary_reverse(g_phi, definition.dictionary_forward(0.37, omega)[1])
np.testing.assert_allclose(grads.d_t, text.d_t, rtol=1e-12)
np.testing.assert_allclose(grads.d_omega, text.d_omega, rtol=1e-11)

_, saved_32 = normalise_forward(phi, statistics_32)
np.testing.assert_allclose(
    normalise_reverse(g_phi, saved_32),
    definition.normalise_reverse(g_phi, definition.atom_statistics(stamps_32, omega)),
    rtol=1e-14,
)

# %% [markdown]
# ## The gradient check
#
# Each derived formula is checked numerically. `check_pair` compares the reverse pass with finite differences of the
# forward pass, along random directions and for single entries. The comparison has no absolute tolerance: a gradient of
# exactly 0 fails the check if the difference is larger than its error bar, however small both are.

# %%
with one_thread():
    reports = [
        check_pair(all_pairs()[name], pair_stream(name, 0))
        for name in ("dictionary", "normalise")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. A clip has $n$ frames at $t=k/n$, of which none is held out. For which $n$ is the sine of 16 cycles dead? Which
#    atoms of other frequencies can be dead for $n\ge20$?
# 2. Write `dictionary_forward` and `dictionary_reverse` with the folding above, and let the golden cases judge them:
#    `--only dictionary` ({doc}`index`). The tolerance of the cases is relative to the largest atom, and the formula as
#    printed passes them too. To see that the folding works, assert the exact 0 at $t=\tfrac{5}{32}$, as above.
# 3. The cell below answers this one. The dictionary has 16 atoms. In a clip of 24 frames with three held out there are
#    21 training stamps, more than there are atoms. Are all 16 atoms linearly independent over these stamps? Are they
#    independent over the stamps of 32 frames with none held out? Estimate the rank of the normalised dictionary in
#    both cases.

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. Over 21 stamps all 16 atoms are independent. Over 32 equally spaced stamps one atom is
# dead, so at most 15 remain; a clip on the grid of the highest frequency is special, and the
# rank is therefore reported. With every eighth frame held out, all other clips of 20 to 80
# frames have rank 16.
assert report_atoms(stamps, omega).rank == 16
# The condition number: how much weaker the faintest combination is than the strongest.
singular = np.linalg.svd(bars, compute_uv=False)
np.testing.assert_allclose(
    report_atoms(stamps, omega).condition, singular[0] / singular[-1], rtol=1e-9
)
assert report_atoms(stamps_32, omega).rank == 15
held_out = lambda n: np.delete(np.arange(n), np.arange(1, n, 8)) / n
ranks = {n: report_atoms(held_out(n), omega).rank for n in range(14, 81)}
print({n: rank for n, rank in ranks.items() if rank < 16})
assert [n for n in ranks if n >= 20 and ranks[n] < 16] == [32]
