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
# # 15. Hard cases
#
# Code that is correct on random input can still be wrong on special input. Each section below gives an input that
# breaks plausible code, names the mistake and states the required result. Before you read a section, predict from its
# title what such code returns. The last section asks whether the gradient check can fail. {doc}`/hard_cases` has the
# full list with a bound and a test for each case, and the naive formulas evaluated in both precisions. The symbols are
# those of {doc}`09_compositing`.
#
# Equation {eq}`eq-b5` of {doc}`/specification/b05_compositing` appears again, because its **form** is what makes the
# first case accurate.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import matplotlib.pyplot as plt
import numpy as np

from endotsr.method.equations.laplacian import (
    laplacian_levels,
    laplacian_loss_forward,
    laplacian_loss_reverse,
    support_masks,
)
from endotsr.method.kernels.constants import Y00
from endotsr.method.losses.depth import (
    depth_target,
    normalised_depth_forward,
    normalised_depth_reverse,
)
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.masked_ssim import (
    masked_ssim_forward,
    masked_ssim_reverse,
    ssim_target,
)
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT, PAPER
from endotsr.port.gradcheck import (
    all_pairs,
    check_function,
    check_pair,
    check_precision,
    one_thread,
    pair_stream,
    summary,
    table,
)

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Set-up of the examples", "code_prompt_hide": "Hide the set-up"}
rng = np.random.default_rng(15)


def made(
    position, log_scale=-2.0, logit=1.0, colour=0.7, quaternion=(1, 0, 0, 0), dtype=np.float64
):
    """Gaussians at given places (3, N); the rest one value for all, or one per Gaussian."""
    position = np.asarray(position, dtype)
    n = position.shape[1]
    rgb = np.broadcast_to(np.asarray(colour, dtype), (3, n))
    return Scene(
        position,
        np.repeat(np.array(quaternion, dtype)[:, None], n, axis=1),
        np.broadcast_to(
            np.asarray(log_scale, dtype).reshape(-1, 1)
            if np.ndim(log_scale) == 1
            else dtype(log_scale),
            (3, n),
        ).copy(),
        np.broadcast_to(np.asarray(logit, dtype), n).copy(),
        ((rgb - dtype(0.5)) / dtype(Y00))[None].copy(),
    )


def render(scene, camera, settings=EXACT, **more):
    return render_forward(scene, camera, settings, degree=0, **more)


small = Camera(np.eye(3), np.zeros(3), 20.0, 20.0, 8.0, 6.0, 16, 12)

# %% [markdown]
# ## The needle: digits lost in the inverse matrix
#
# A needle of $1000$ pixels, seen at an angle, has $a\approx b\approx c\approx5\cdot10^5$. The textbook form is
# $q=(c\,d_x^2-2b\,d_xd_y+a\,d_y^2)/\det$. At a distance of $1000$ pixels its three products are $2.5\cdot10^{11}$,
# $5\cdot10^{11}$ and $2.5\cdot10^{11}$, and $\det$ is about $3\cdot10^5$, while $q$ should be about 1. In float32 each
# product is wrong by some $10^4$, which leaves about one digit of $q$. The specification writes a sum of squares:
#
# $$
# \begin{aligned}
# \eta&=d_x-m\,d_y,\\
# q&=r\,d_y^2+A\,\eta^2=\frac{d_y^2}{c}+\frac{c}{\det}\Bigl(d_x-\frac bc\,d_y\Bigr)^2,\\
# \alpha&=\min\bigl(\alpha_{\max},\ o\,e^{-q/2}\bigr).
# \end{aligned}
# $$


# %% tags=["transcription"]
def alpha_text(d_x, d_y, a, b, c, det, o):
    m, r, A = b / c, 1 / c, c / det
    eta = d_x - m * d_y
    q = r * d_y**2 + A * eta**2
    return np.minimum(1, o * np.exp(-q / 2))


def textbook(d_x, d_y, a, b, c, det, o):
    q = (c * d_x**2 - 2 * b * d_x * d_y + a * d_y**2) / det
    return np.minimum(1, o * np.exp(-q / 2))


# %%
# Its centre is 700 px off the image.
wide = Camera(np.eye(3), np.zeros(3), 100.0, 100.0, -700.0, -700.0, 300, 300)
eighth_turn = (np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8))
needle = dict(
    position=[[0.0], [0.0], [1.0]],
    log_scale=np.log([10.0, 1e-3, 1e-3]),
    logit=2.0,
    quaternion=eighth_turn,
)
double, saved = render(made(**needle), wide)
single, saved_32 = render(made(**needle, dtype=np.float32), wide)
a, b, c = saved.projected.covariance2d[:, 0]
det, o = saved.projected.determinant[0], 1 / (1 + np.exp(-2.0))
along = np.arange(300)
np.testing.assert_allclose((a, b, c, det), (5e5, 5e5, 5e5, 3e5), rtol=0.05)
leg = 1000 / np.sqrt(2)  # of the distance along the diagonal
np.testing.assert_allclose((c * leg**2, 2 * b * leg**2), (2.5e11, 5e11), rtol=0.05)
# The pixels of the diagonal, which the needle covers.
d = along + 0.5 - saved.projected.mean2d[:, :1]
truth = double.opacity[along, along]
np.testing.assert_allclose(truth, alpha_text(*d, a, b, c, det, o), rtol=1e-9)
parts_32 = [
    np.float32(x)
    for x in (*saved_32.projected.covariance2d[:, 0], saved_32.projected.determinant[0], o)
]
lost = textbook(*d.astype(np.float32), *parts_32)
np.testing.assert_allclose(single.opacity[along, along], truth, rtol=1e-6)
beside = (
    along[:-1],
    along[1:],
)  # where the determinant counts: ac - b^2 in float32 would be off by 4 %
np.testing.assert_allclose(single.opacity[beside], double.opacity[beside], rtol=1e-3)
print(
    "endotsr in float32:",
    np.abs(single.opacity[along, along] / truth - 1).max(),
    " textbook:",
    np.abs(lost / truth - 1).max(),
)
error_of_q = 2 * np.abs(np.log(lost / truth))  # alpha is proportional to exp(-q / 2)
assert 0.03 < np.median(error_of_q) < 0.3, "about one digit of q"
# The same formula, while digits last.
np.testing.assert_allclose(textbook(*d, a, b, c, det, o), truth, rtol=1e-6)

# %% [markdown]
# ## Equal depths: an undefined order
#
# Stereo depth is often a whole number, so equal depths are common at the start of training. With a sort that is not
# stable, the picture may change from run to run. The required order of Gaussians with equal $z$ is that of their
# indices. With distinct $z$, the image is bitwise independent of the order of the input.

# %%
tie = made([[0.0, 0.0], [0.0, 0.0], [2.0, 2.0]], colour=[[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
middle = render(tie, small)[0].colour[:, 6, 8]
assert middle[0] > middle[2], "index 0 is in front"
many = made(
    np.vstack([rng.uniform(-1, 1, (2, 30)), rng.uniform(2, 4, 30)]),
    colour=rng.uniform(0, 1, (3, 30)),
)
shuffle = rng.permutation(30)
shuffled = Scene(*(part[..., shuffle].copy() for part in many[:5]))
assert np.array_equal(render(many, small)[0].colour, render(shuffled, small)[0].colour)

# %% [markdown]
# **Crossing depths.** When two Gaussians cross in depth, the image jumps by $\alpha_1\alpha_2(rgb_1-rgb_2)$, times the
# transmittance in front of them. The derivative does not contain this jump. The gradient check therefore refuses
# differences across a change of order.


# %%
def crossing(gap):
    return render(
        made(
            [[0.0, 0.0], [0.0, 0.0], [2.0, 2.0 + gap]],
            colour=[[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]],
        ),
        small,
    )


(before, stage), (after, _) = crossing(1e-9), crossing(-1e-9)
alpha = (1 / (1 + np.exp(-1.0))) * np.exp(
    -0.5 * (0.25 + 0.25) / stage.projected.covariance2d[0, 0]
)
jump = before.colour[:, 6, 8] - after.colour[:, 6, 8]
np.testing.assert_allclose(jump, alpha**2 * np.array([1.0, 0.0, -1.0]), atol=1e-6)

# %% [markdown]
# ## Behind the camera, on the near plane, at the camera
#
# For a Gaussian behind the camera or in its plane, a division by $z$ mirrors it into the picture or gives infinity.
# Such a Gaussian must not contribute. Its gradients are exactly 0, not merely small, and the image is bitwise that of
# the scene without it.

# %%
plain = made([[0.1], [0.0], [2.0]])
for z in (-1.0, 0.0, 1e-300, PAPER.near):
    both = made([[0.1, 0.0], [0.0, 0.0], [2.0, z]])
    out, saved = render(both, small, PAPER)
    assert np.array_equal(out.colour, render(plain, small, PAPER)[0].colour)
    grads = render_reverse(np.ones_like(out.colour), np.ones_like(out.depth), None, saved)
    assert not any(
        np.any(getattr(grads, f"d_{name}")[..., 1])
        for name in ("position", "quaternion", "log_scale", "opacity_logit")
    )

# %% [markdown]
# ## Empty input
#
# Pruning may leave no Gaussian. The image is then the background, and there is no gradient. An image of one pixel is
# valid.

# %%
nothing = made(np.zeros((3, 0)))
out, saved = render(
    nothing, small._replace(width=1, height=1), background=np.array([0.1, 0.2, 0.3])
)
assert out.colour.ravel().tolist() == [0.1, 0.2, 0.3] and out.depth.item() == 0
assert render_reverse(out.colour, out.depth, None, saved).d_position.shape == (3, 0)

# %% [markdown]
# ## Two thousand faint sheets
#
# For $n$ equal sheets of opacity $\alpha$ and colour $c$, the image must be $c\,\bigl(1-(1-\alpha)^n\bigr)$. The
# opacity image is the **sum** of the weights. The alternative $1-T_n$ would be 0 in float32 for one sheet of
# $\alpha=10^{-8}$. (The fast path of training computes $1-T_n$. It has a cutoff, and below it no sheet is drawn.)

# %%
n, faint = 2000, 1e-3
sheets = made(
    np.vstack([np.zeros((2, n)), np.linspace(2, 3, n)]),
    log_scale=8.0,
    logit=np.log(faint / (1 - faint)),
    colour=0.8,
)
value = render(sheets, small)[0].colour[0, 6, 8]
expected = 0.8 * -np.expm1(n * np.log1p(-faint))
np.testing.assert_allclose(value, expected, rtol=1e-5)
one_sheet = made([[0.0], [0.0], [2.0]], log_scale=8.0, logit=np.log(1e-8), dtype=np.float32)
assert render(one_sheet, small)[0].opacity[6, 8] > 0.99e-8
assert 1 - (np.float32(1) - np.float32(1e-8)) == 0, "one minus the transmittance"

# %% [markdown]
# ## NaN under the instrument, and an empty level
#
# Values under the mask are removed by selection, never by multiplication, because $0\cdot\mathrm{NaN}$ is NaN. If the
# mask leaves a level of the pyramid without a valid value, that level has loss 0, not the mean of an empty set.

# %%
image, observed = rng.uniform(size=(3, 40, 48)), rng.uniform(size=(3, 40, 48))
mask = np.ones((40, 48), bool)
mask[5:30, 20:31] = False
depth, prior = rng.uniform(40, 60, mask.shape), rng.uniform(40, 60, mask.shape)
depth[0, 0], prior[0, 0] = 70, 70  # the maxima of the whole image are on tissue


def losses(image, observed, prior):
    target, supports = ssim_target(observed, mask), support_masks(mask)
    l1, l1_saved = masked_l1_forward(image, observed, mask)
    ssim, ssim_saved = masked_ssim_forward(image, target)
    lap, lap_saved = laplacian_loss_forward(image, observed, supports)
    d, d_saved = normalised_depth_forward(depth, depth_target(prior, mask))
    values = (l1, ssim, lap, d)
    return values, [
        masked_l1_reverse(1.0, l1_saved),
        masked_ssim_reverse(1.0, ssim_saved),
        laplacian_loss_reverse(1.0, lap_saved),
        normalised_depth_reverse(1.0, d_saved),
    ]


clean_values, clean = losses(image, observed, prior)
for poison in (np.nan, np.inf, 1e300):
    values, grads = losses(
        *(np.where(mask, x, poison) for x in (image, observed)), np.where(mask, prior, np.nan)
    )
    assert values == clean_values and all(np.array_equal(x, y) for x, y in zip(grads, clean))

slit = np.zeros((40, 48), bool)
slit[:, 20:31] = True
supports = support_masks(slit)
print("valid values per level:", supports.counts)
assert supports.counts[0] > 0 and supports.counts[2] == 0
loss, saved = laplacian_loss_forward(image, observed, supports)
assert np.isfinite(laplacian_loss_reverse(1.0, saved)).all()
bands = [laplacian_levels(np.where(slit, x, 0)).bands for x in (image, observed)]
of_levels = [
    np.abs(p - q)[:, valid].mean() for p, q, valid in zip(*bands, supports.bands) if valid.any()
]
np.testing.assert_allclose(loss, sum(of_levels) / 3, rtol=1e-12)  # the empty level adds 0

# %% [markdown]
# ## The same scene in metres, millimetres, micrometres
#
# A constant with a hidden unit, such as a fixed near plane or an epsilon added to $z$, changes the picture when the
# unit changes. The picture of a scene must be the same in every unit, and its depth must scale with the unit.

# %%
reference = render(many, small, PAPER)[0]
for factor in (1e-3, 1e3):
    scaled = many._replace(
        position=many.position * factor, log_scale=many.log_scale + np.log(factor)
    )
    again = render(scaled, small, PAPER._replace(near=PAPER.near * factor))[0]
    np.testing.assert_allclose(again.colour, reference.colour, atol=1e-11)
    np.testing.assert_allclose(
        again.depth, reference.depth * factor, rtol=1e-9, atol=1e-9 * factor
    )

# %% [markdown]
# ## Figure: three of these cases
#
# The left panel shows the needle in both forms and precisions, the middle panel the jump of two crossing depths, and
# the right panel the equal sheets.

# %% tags=["hide-input"]
figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.2), layout="constrained")
axes[0].plot(along, truth, color="0.7", lw=5, label="float64")
axes[0].plot(along, lost, color="tab:red", lw=0.8, label="textbook form, float32")
axes[0].plot(
    along, single.opacity[along, along], color="tab:green", lw=1.2, label="endotsr, float32"
)
axes[0].set(
    title="$\\alpha$ along a needle of 1000 px", xlabel="pixel on the diagonal", ylim=(0, 1)
)
axes[0].legend(loc="upper right")
gaps = np.linspace(-0.4, 0.4, 81)
seen = np.array([crossing(gap)[0].colour[:, 6, 8] for gap in gaps])
for channel, colour in ((0, "tab:red"), (2, "tab:blue")):
    axes[1].plot(gaps, np.where(np.abs(gaps) < 1e-9, np.nan, seen[:, channel]), color=colour)
axes[1].set(
    title="two Gaussians pass in depth: a jump",
    xlabel="$z_1-z_0$",
    ylabel="colour of the pixel",
)
counts = np.unique(np.geomspace(1, 2000, 25).astype(int))
for alpha_one, colour in ((1e-3, "tab:blue"), (1e-2, "tab:orange"), (0.1, "tab:green")):
    stack = [
        render(
            made(
                np.vstack([np.zeros((2, k)), np.linspace(2, 3, k)]),
                log_scale=8.0,
                logit=np.log(alpha_one / (1 - alpha_one)),
                colour=0.8,
            ),
            small,
        )[0].colour[0, 6, 8]
        for k in counts
    ]
    axes[2].semilogx(counts, stack, "o", color=colour, ms=4, label=f"$\\alpha={alpha_one:g}$")
    axes[2].semilogx(counts, 0.8 * -np.expm1(counts * np.log1p(-alpha_one)), color=colour, lw=1)
axes[2].set(
    title="equal sheets: dots render, lines $c\\,(1-(1-\\alpha)^n)$",
    xlabel="number of sheets $n$",
    ylabel="colour of the pixel",
)
axes[2].legend()
plt.show()

# %% [markdown]
# ## The reverse pass: a check that can fail
#
# The gradient check is applied to one correct reverse pass and to four wrong ones: a flipped sign, a gradient that is
# too large by one thousandth, a zero gradient, and one missing Gaussian, which has the index 2. It must refuse all four
# and name the slice of the missing Gaussian.

# %%
pair = all_pairs()["matern_penalty"]
inputs = pair.inputs(pair_stream("matern_penalty", 0))


def forgetful(gradient):
    gradient = gradient.copy()
    gradient[..., 2] = 0
    return gradient


wrong = {
    "right": lambda g: g,
    "sign": lambda g: -g,
    "factor 1.001": lambda g: 1.001 * g,
    "zero": lambda g: 0 * g,
    "one forgotten": forgetful,
}
with one_thread():
    for name, damage in wrong.items():
        report = check_function(
            pair.forward,
            lambda i, up, damage=damage: {
                key: damage(g) for key, g in pair.reverse(i, up).items()
            },
            inputs,
            hard={"motion_coefficients": np.arange(inputs["motion_coefficients"].size)},
        )
        verdict = "accepted" if report.passed else f"refused: {report.failures[-1][:90]}"
        print(f"{name:14s} {verdict}")
        assert report.passed == (name == "right")
        assert ("slice [:, :, 2]" in verdict) == (name == "one forgotten")

# %% [markdown]
# The next cell checks the whole render, in float64 against differences and in float32 against float64:

# %%
with one_thread():
    report = check_pair(all_pairs()["render_blocks"], pair_stream("render_blocks", 0))
    precision = check_precision(all_pairs()["render_blocks"], pair_stream("render_blocks", 0))
print(table([report], [precision]))
print(summary([report], [precision]))
assert report.passed and precision.passed

# %% [markdown]
# ## Exercise
#
# 1. A needle has $\sigma_1/\sigma_2=10^4$. How many of the 7 digits of float32 does $ac-b^2$ keep, and how many does a
#    sum of two squares keep?
# 2. Run the hardest cases of the compositing on your own pair: `--only composite` ({doc}`index`). Which of your
#    formulas fails in float32 and passes in float64?
# 3. The cell below answers this one. A quaternion of exactly 0 is not a rotation. The deformation model can produce
#    it, because it adds to the raw quaternion. What should the image be, and what should the gradient be? Why would it
#    be worse to add a small epsilon to the norm?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The identity rotation and no gradient: a defined result. With an epsilon, the matrix
# is not a rotation (R = 1 - 2(y^2 + z^2) with a q that is too short), for every short
# quaternion and not only for 0.
identity, zero = (
    made([[0.0], [0.0], [2.0]], log_scale=[-1.0, -2.0, -1.5], quaternion=q)
    for q in ((1, 0, 0, 0), (0, 0, 0, 0))
)
(one, _), (two, saved) = render(identity, small), render(zero, small)
assert np.array_equal(one.colour, two.colour)
assert not render_reverse(
    np.ones_like(two.colour), np.ones_like(two.depth), None, saved
).d_quaternion.any()
