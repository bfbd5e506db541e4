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
# # 13. The optimiser and density control
#
# The gradients of positions, colours and coefficients differ by orders of magnitude, and the number of Gaussians that
# a scene needs is not known in advance. Adam divides the scale of the gradients out of the steps. Density control
# changes the number: every hundred iterations it adds Gaussians where the screen gradient is large, and removes
# Gaussians whose opacity is small.
#
# The equations are {eq}`eq-b10` of {doc}`/specification/b10_adam` and {eq}`eq-b11` of
# {doc}`/specification/b11_density`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import msgspec
import numpy as np
from running_clip import load
from scipy.ndimage import uniform_filter

from endotsr.config import PAPER, DensityConfig
from endotsr.definition import adam as definition
from endotsr.definition import density_control as definition_of_density
from endotsr.definition import schedules as definition_of_schedules
from endotsr.method.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.method.losses.masked_ssim import (
    masked_ssim_forward,
    masked_ssim_reverse,
    ssim_target,
)
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import covariance_forward
from endotsr.method.splatting.render import Scene, render_forward, render_reverse
from endotsr.method.splatting.settings import EXACT
from endotsr.method.splatting.settings import PAPER as RASTER
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.training.fitting.adam import adam_state, adam_step, adam_update, regather
from endotsr.training.fitting.schedules import active_degree, densify_now, learning_rates
from endotsr.training.scene.density_control import (
    DensityStatistics,
    densify,
    empty_statistics,
    gather_statistics,
)
from endotsr.training.scene.gaussians import Gaussians, arrays

# %%
rng = np.random.default_rng(12)

# %% [markdown]
# ## Adam
#
# $$
# \begin{aligned}
# m&\leftarrow\beta_1m+(1-\beta_1)g,\qquad v\leftarrow\beta_2v+(1-\beta_2)g^2,\\
# \theta&\leftarrow\theta-\eta\,\frac{m/(1-\beta_1^{k})}{\sqrt{v/(1-\beta_2^{k})}+\epsilon} .
# \end{aligned}
# $$
#
# Here $\theta$ is one stored number, $g$ its gradient and $\eta$ its rate. Its two moments $m$ and $v$ begin at 0. The
# constants are $\beta_1=0.9$, $\beta_2=0.999$ and $\epsilon=10^{-15}$, and $k=1,2,\dots$ counts the steps of one
# array.
#
# **(13.1) Two averages.** Unrolled from $m=0$, the recursion is $m_k=(1-\beta_1)\sum_{j=1}^{k}\beta_1^{k-j}g_j$. This
# is an average of the gradients in which old ones fade. In the same way $v_k$ is an average of $g_j^2$. With $\beta_2$
# old ones take $\ln0.9/\ln0.999\approx105$ times as many steps to fade. A first moment below the smallest normal float32 number,
# $1.18\cdot10^{-38}$, is set to 0: it moves a parameter by less than $2\cdot10^{-22}\,\eta$, and arithmetic with such
# numbers can be slow.
#
# **(13.2) Their bias.** The weights of the sum add up to $1-\beta_1^k$ and not to 1, because the average begins with
# 0. Division by $1-\beta_1^k$ turns the sum into a weighted mean. Division by $1-\beta_2^k$ does the same for $v$.
#
# **(13.3) The first step depends on the sign only.** For $k=1$ both corrections are exact: the corrected moments are
# $g$ and $g^2$. The step is $\eta\,g/(|g|+\epsilon)$. As long as $|g|$ is much larger than $\epsilon$, this is
# $\eta\operatorname{sign}(g)$, for a gradient of 1 as for one of $10^{-10}$.
#
# **(13.4) A common factor cancels.** If all gradients of an array are multiplied by $c>0$, both $m$ and $\sqrt v$ are
# multiplied by $c$. The steps stay the same as long as $\epsilon$ is negligible, so a factor on the whole objective
# changes no step of Adam. It does change the statistic of density control below.
#
# <!-- definition: endotsr.definition.adam.adam_step -->
# ```python
# def adam_step(parameter, gradient, first, second, step, learning_rate, beta1, beta2, epsilon):
#     """Equation (B10): parameter, m and v after step k = 1, 2, ...; a rate may have the shape of the parameter."""
#     m = beta1 * first + (1 - beta1) * gradient  # (13.1)
#     v = beta2 * second + (1 - beta2) * gradient**2
#     m = np.where(np.abs(m) < SMALLEST, 0, m)
#     change = m / (1 - beta1**step) / (np.sqrt(v / (1 - beta2**step)) + epsilon)  # (13.2)
#     return parameter - learning_rate * change, m, v
# ```

# %%
constants = (PAPER.optimiser.beta1, PAPER.optimiser.beta2, PAPER.optimiser.epsilon)
assert constants == (0.9, 0.999, 1e-15)
theta = rng.normal(size=(3, 40))
mine = (theta.copy(), np.zeros_like(theta), np.zeros_like(theta))
kernel = [part.copy() for part in mine]
for k in range(1, 30):
    g = rng.normal(size=theta.shape) * 10.0 ** rng.integers(-8, 3, theta.shape)
    mine = definition.adam_step(mine[0], g, mine[1], mine[2], k, 1e-3, *constants)
    adam_step(kernel[0], g, kernel[1], kernel[2], k, 1e-3, *constants)
    for found, text in zip(kernel, mine):
        np.testing.assert_allclose(found, text, rtol=1e-12)

# `adam_update` steps every array by name and counts for each
state, named = adam_state({"theta": theta}), {"theta": theta.copy()}
mine = (theta.copy(), np.zeros_like(theta), np.zeros_like(theta))
for k in (1, 2, 3):
    mine = definition.adam_step(mine[0], theta**k, mine[1], mine[2], k, 1e-3, *constants)
    adam_update(state, named, {"theta": theta**k}, {"theta": 1e-3}, *constants)
np.testing.assert_allclose(named["theta"], mine[0], rtol=1e-12)

# %% [markdown]
# Step (13.3) has a consequence for the whole package. With $\epsilon=10^{-15}$ even rounding noise can move a
# parameter by a full step, so every sum of the package has a fixed order. The next cell checks (13.3) and (13.4).

# %%
for size in (1.0, 1e-10):
    p = np.zeros(2)
    adam_step(p, np.array([size, -size]), np.zeros(2), np.zeros(2), 1, 0.01, *constants)
    np.testing.assert_allclose(p, [-0.01, 0.01], rtol=2e-5)

paths = []
for factor in (1.0, 1e3):
    p, m, v = np.zeros(40), np.zeros(40), np.zeros(40)
    stream = np.random.default_rng(1)
    for k in range(1, 30):
        adam_step(p, factor * stream.normal(size=40), m, v, k, 0.01, *constants)
    paths.append(p)
np.testing.assert_allclose(*paths, rtol=1e-9)

# %% [markdown]
# ## The rates
#
# By (13.3) the rate is the size of the first step. Each array has its own rate, because a step of one size has
# different effects on a position and on an opacity. Let $i$ be the iteration, $T=6000$ the last one, and $K_s=3000$
# the last one without the residuals $A$ and $C$. In `paper` the rates are:
#
# | Array | Symbol | Rate $\eta_0$ | Course |
# |---|---|---|---|
# | position | $\mu$ | $1.6\cdot10^{-3}$ | decays |
# | deformation: weights, centres, widths | $w,\theta,\sigma$ | $1.6\cdot10^{-3}$ | decays |
# | opacity logit | $o=1/(1+e^{-\mathrm{logit}})$ | $0.05$ | constant |
# | log-scale | $s$ | $0.005$ | constant |
# | quaternion | $\tilde q$ | $0.001$ | constant |
# | harmonics of degree 0 | $h_0$ | $2.5\cdot10^{-3}$ | constant |
# | harmonics of degree 1 to 3 | $h_1,\dots,h_{15}$ | $1.25\cdot10^{-4}$ | constant |
# | colour residual | $A$ | $3.125\cdot10^{-3}$ | decays from $K_s$ |
# | translation residual | $C$ | $1.6\cdot10^{-4}$ | decays from $K_s$ |
#
# The harmonics are one array with one step count, although their rates differ. At $i=K_s+1$ the arrays $A$ and $C$ are
# added. They are filled with 0 and have moments 0 and step count 0.
#
# The function `learning_rates` below has two more factors, which are 1 in `paper`. `deformation_position_factor`
# multiplies the rate of the weights of the position channels. After iteration `annealing_from`, the constant rates
# decay to the fraction `annealed_factor` of their value. The exposure of a frame ({doc}`11_base_losses`) and the
# correction of a pose ({doc}`07_projection`) are options that `paper` does not use.
#
# **(13.5) Exponential decay.** A decaying rate falls to the fraction $\varphi=0.01$ of its start. Every iteration
# multiplies it by the same factor, which is $\varphi^{1/T}$ if the decay starts at iteration 0. The decay of the
# residuals starts at $K_s$:
#
# $$
# \begin{aligned}
# \eta(i)&=\eta_0\,\varphi^{\tau},\\
# \tau&=\begin{cases}\mathrm{clip}(i/T,0,1)&\text{position, FDM, exposure, poses}\\ \mathrm{clip}\bigl((i-K_s)/(T-K_s),0,1\bigr)&\text{residuals.}\end{cases}
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.schedules.decay -->
# ```python
# def decay(step, steps, final):
#     """final^tau, tau = clip(step / steps, 0, 1); without steps, tau = [step > 0]."""
#     return final ** (min(max(step / steps, 0), 1) if steps > 0 else step > 0)  # (13.5)
# ```
#
# <!-- definition: endotsr.definition.schedules.learning_rates -->
# ```python
# def learning_rates(iteration, config):
#     """Equation (B10): rates by array; parts of the leading axis as ((slice, rate), ...)."""
#     o, total, activated = config.optimiser, config.training.iterations, config.training.residual_activation
#     falling = decay(iteration, total, o.final_factor)
#     constant = decay(iteration - o.annealing_from, total - o.annealing_from, o.annealed_factor)
#     fdm = o.deformation * falling
#     rates = {
#         "position": o.position * falling,
#         "quaternion": o.rotation * constant,
#         "log_scale": o.scale * constant,
#         "opacity_logit": o.opacity * constant,
#         "harmonics": ((slice(0, 1), o.harmonics_base * constant), (slice(1, None), o.harmonics_rest * constant)),
#         "fdm_weight": ((slice(0, 3), fdm * o.deformation_position_factor), (slice(3, 10), fdm)),
#         **dict.fromkeys(("fdm_centre", "fdm_width"), fdm),
#         **dict.fromkeys(EXPOSURES if config.model.exposure else (), o.exposure * falling),
#     }
#     if residuals_active(iteration, config):
#         start = activated if o.restart_residual_schedule else 0
#         residual = o.deformation * decay(iteration - start, total - start, o.final_factor)
#         rates["appearance_coefficients"] = residual * o.appearance_factor
#         rates["motion_coefficients"] = residual * o.spectral_motion_factor
#     return rates
# ```

# %% tags=["hide-input"]
T, K_s = PAPER.training.iterations, PAPER.training.residual_activation
o = PAPER.optimiser
assert (T, K_s, o.final_factor) == (6000, 3000, 0.01), "what the text says"
falling = (o.position, o.deformation, o.deformation * o.deformation_position_factor)
np.testing.assert_allclose(falling, 1.6e-3)
constant = (o.opacity, o.scale, o.rotation, o.harmonics_base, o.harmonics_rest)
assert constant == (0.05, 0.005, 0.001, 2.5e-3, 1.25e-4) and o.annealed_factor == 1
residual = o.deformation * o.appearance_factor, o.deformation * o.spectral_motion_factor
np.testing.assert_allclose(residual, (3.125e-3, 1.6e-4))
figure, axis = plt.subplots(figsize=(7, 3.2), layout="constrained")
steps = np.arange(1, T + 1, 10)
for name, label in (
    ("position", "position, FDM"),
    ("appearance_coefficients", "colour residual A"),
    ("motion_coefficients", "translation residual C"),
    ("opacity_logit", "opacity"),
    ("log_scale", "scale"),
    ("quaternion", "rotation"),
):
    values = [learning_rates(int(i), PAPER).get(name, np.nan) for i in steps]
    axis.semilogy(steps, values, label=label)
axis.axvspan(500, 4000, color="0.93", label="density control")
axis.set(title="learning rates, preset paper", xlabel="iteration", ylim=(3e-8, 0.2))
axis.legend(loc="lower left", ncols=2)
plt.show()

# %%
for i in (1, 1500, 3000, 3001, 4500, 6000):
    rates, text = learning_rates(i, PAPER), definition_of_schedules.learning_rates(i, PAPER)
    assert set(rates) == set(text) and ("appearance_coefficients" in rates) == (i > K_s)
    for name in ("position", "fdm_centre", "quaternion", "log_scale", "opacity_logit"):
        np.testing.assert_allclose(rates[name], text[name], rtol=1e-12)
    if i > K_s:
        for name, start in (
            ("appearance_coefficients", 3.125e-3),
            ("motion_coefficients", 1.6e-4),
        ):
            np.testing.assert_allclose(rates[name], text[name], rtol=1e-12)
            share = (i - K_s) / (T - K_s)
            np.testing.assert_allclose(rates[name], start * 0.01**share, rtol=1e-12)
assert [active_degree(i, PAPER) for i in (499, 500, 1000, 1500, 6000)] == [0, 1, 2, 3, 3]
assert [i for i in range(1, T) if densify_now(i, PAPER)] == list(range(600, 4000, 100))

# %% [markdown]
# ## Density control
#
# The gradient with respect to the screen centre of a Gaussian says how strongly the loss would change if the Gaussian
# moved on the screen. A large one is taken as a sign that one Gaussian covers a region that needs two. This is the
# heuristic of 3DGS ({doc}`/references`). Density control compares a mean of this gradient with a threshold, adds a
# Gaussian where the threshold is reached, and removes Gaussians that are almost transparent.
#
# | Symbol | Meaning | In `paper` |
# |---|---|---|
# | $g_{u_i},g_{v_i}$ | gradient of the whole objective with respect to the screen centre, per pixel ({doc}`09_compositing`) | |
# | $W,H$ | width and height of the image in pixels | |
# | $o_i$ | opacity, the sigmoid of the stored logit | |
# | $S_i=e^{s_i}$ | the three stored semi-axes, in scene units ({doc}`06_covariance`) | |
# | $R(q_i)$ | rotation of the Gaussian ({doc}`06_covariance`) | |
# | $g_{\mathrm{thr}}$ | threshold: least $\bar g_i$ of a candidate, `density.gradient_threshold` | $2\cdot10^{-4}$ |
# | $o_{\mathrm{min}}$ | least opacity of a Gaussian that stays, `density.prune_opacity` | 0.005 |
# | $e$ | extent of the scene, in scene units, `density.extent` | 10 |
# | $p$ | the fraction of the extent that separates small from large, `density.dense_fraction` | 0.01 |
# | $M$ | largest number of Gaussians, `density.maximum` | 400 000 |
#
# **(13.6) The statistic, and its unit.** In normalised device coordinates $(x,y)$ the image reaches from $-1$ to $1$,
# so $\mathrm du=\frac W2\,\mathrm dx$ and $\mathrm dv=\frac H2\,\mathrm dy$. By the chain rule $g_x=\frac W2g_u$ and
# $g_y=\frac H2g_v$. The statistic is the mean of the norm of $(g_x,g_y)$ over the views in which the Gaussian is
# visible:
#
# $$
# \bar g_i=\frac{\sum_{\text{visible}}\Bigl\|\bigl(\tfrac W2g_{u_i},\ \tfrac H2g_{v_i}\bigr)\Bigr\|_2}{\sum_{\text{visible}}1}
# $$
#
# Each iteration before `density.until` adds its one view to both sums. A Gaussian is *visible* in a view if it is in
# front of the near plane and the box around its support, the ellipse with $\alpha\ge\alpha_{\mathrm{cut}}$, contains
# the centre of a pixel of the image ({doc}`09_compositing` has the sides of the box). A Gaussian that no view has shown
# has $\bar g_i=0$.
#
# The gradient is not left per pixel for the following reason. The losses are means over pixels, so an image of twice
# the size has about half the gradient per pixel and about the same $\bar g_i$, as the set-up below measures for one
# smooth gradient image. A threshold then need not follow the size.
#
# **When the rule runs.** The rule runs at the iterations that are multiples of `density.interval`, after
# `density.start` and before `density.until`: in `paper` at 600, 700, …, 3900. It reads and writes the stored
# parameters after the step of Adam, not the deformed ones. Afterwards both sums of all Gaussians are set to 0, so
# $\bar g_i$ is a mean over the views since the rule last ran.
#
# **(13.7) Prune, then choose.** A Gaussian with $o_i<o_{\mathrm{min}}$ is removed, with its moments of Adam. $N$
# Gaussians stay. A *candidate* is one of these whose statistic reaches the threshold, equality included:
#
# $$
# o_i\ge o_{\mathrm{min}}\quad\text{and}\quad\bar g_i\ge g_{\mathrm{thr}}
# $$
#
# Each candidate adds one Gaussian, so there is room for $M-N$ of them. If there are more candidates than that, those
# with the largest $\bar g_i$ remain; of equal ones, those with the lower index. (With a budget, as in the preset `quick`,
# (20.1) replaces threshold and room.)
#
# **(13.8) Clone or split.** A candidate with $\max_kS_{ki}\le p\,e$, which is 0.1 scene units in `paper`, counts as
# small. It is *cloned*: it stays, and an exact copy is added at the same place. A candidate with
# $\max_kS_{ki}>p\,e$ is *split*: two children replace it. Each child lies at a point that is drawn from the Gaussian
# of its parent, and its semi-axes are shorter by the factor 1.6:
#
# $$
# \mu'=\mu_i+R(q_i)\,(S_i\odot\xi),\qquad s'=s_i-\ln1.6,\qquad \xi\sim\mathcal N(0,I_3)
# $$
#
# Here $\odot$ multiplies entry by entry. Everything else follows from the parent $i$ in the same way for clones and
# children:
#
# | Quantity | Clone of $i$ | Each child of $i$ |
# |---|---|---|
# | position | $\mu_i$ | $\mu'$, with a $\xi$ of its own |
# | log-scale | $s_i$ | $s'$ |
# | opacity logit, quaternion, harmonics | those of $i$ | those of $i$ |
# | time bases of the deformation, $A$, $C$ | those of $i$ | those of $i$ |
# | moments of Adam | 0 | 0 |
# | sums of the statistic | 0 | 0 |
# | Gaussian $i$ itself | stays, with its moments | is removed, with its moments |
#
# The opacity of the parent is not divided among its children. The step count of Adam belongs to an array and
# continues.
#
# **Order and random numbers.** The new order of the arrays is: the Gaussians that stay and were not split, in their
# old order; the clones; the first children; the second children. Clones and children are in the order of their
# parents. All $\xi$ are one draw of shape (2, 3, number of splits) from the generator of the run (`training.seed`):
# the first axis is the first or the second child, the second axis holds the three numbers of $\xi$, and the third axis
# is the parent. Without a split there is no draw. {doc}`/specification/rulings` lists the choices that the paper
# leaves open, with their alternatives: *end of density control*, *density extent* and *children*.
#
# **(13.9) What the children cover.** The covariance of $\xi$ is $I$, so that of $R\,(S\odot\xi)$ is
# $R\,\mathrm{diag}(S)^2R^\top=\Sigma$: the displacement of a child has the covariance of its parent. The two positions
# have the expected covariance $\frac12\Sigma$ about their mean, and each child has the covariance $\Sigma/1.6^2$. Together the pair has
# $(\frac12+\frac1{2.56})\Sigma=0.89\,\Sigma$ in expectation. It covers about the region of the parent, with twice as
# many parameters.
#
# **(13.10) The opacity stays.** Two layers of the same $\alpha$ at one place absorb $1-(1-\alpha)^2$, which is more
# than one of them absorbs if $0<\alpha<1$. A clone that is seen therefore changes the picture in general. Its moments are 0 and
# those of its parent in general are not, so the next step of Adam moves the two apart, even if their gradients are
# equal. 3DGS also resets opacities at
# intervals; `paper` does not.
#
# **The extent.** With a moving camera, `density.extent = "cameras"` sets $e=1.1\max_k\|\mathbf o_k-\bar{\mathbf o}\|$
# over the optical centres $\mathbf o_k$ of the training frames, as 3DGS does. For a camera that rests this is 0. An
# error is raised, because $e=0$ would split every candidate.
#
# <!-- definition: endotsr.definition.density_control.gather_statistics -->
# ```python
# def gather_statistics(statistics, d_mean, visible, width, height):
#     """Equation (B11): add one view to the statistics; d_mean (2, N) per px, visible (N,)."""
#     norm = np.sqrt((width / 2 * d_mean[0]) ** 2 + (height / 2 * d_mean[1]) ** 2)  # (13.6)
#     return DensityStatistics(statistics.gradient_sum + np.where(visible, norm, 0), statistics.visits + visible)
# ```
#
# <!-- definition: endotsr.definition.density_control.densify -->
# ```python
# def densify(gaussians, statistics, config, rng, extent, remaining=1):
#     """Equation (B11): prune, clone and split, with `remaining` runs left, this one included.
#
#     Draws: one `rng.standard_normal((2, 3, splits))`, none without a split.
#     """
#     alive = opacity_of(gaussians.opacity_logit) >= config.prune_opacity
#     steepness = statistics.gradient_sum / np.maximum(statistics.visits, 1)
#     by_threshold = config.growth == "threshold"
#     steep = steepness >= config.gradient_threshold if by_threshold else steepness > 0
#     runs = 1 if by_threshold else remaining  # a budget is shared by the runs that are left
#     candidates = np.flatnonzero(alive & steep)  # (13.7)
#     room = -(-max(0, config.maximum - alive.sum()) // runs)  # (20.1), (20.3)
#     steepest_first = candidates[np.argsort(-steepness[candidates], kind="stable")]
#     candidates = np.sort(steepest_first[:room])
#     large = np.exp(gaussians.log_scale[:, candidates]).max(axis=0, initial=0) > config.dense_fraction * extent
#     clone = candidates[~large]
#     split = candidates[large]  # (13.8)
#     survivors = np.setdiff1d(np.flatnonzero(alive), split)
#     source = np.concatenate([survivors, clone, split, split])
#     made = type(gaussians)(*(None if array is None else array[..., source] for array in gaussians))
#     if split.size:
#         made = with_children(made, rng.standard_normal((2, 3, split.size)))
#     plan = GatherPlan(source, survivors.size)
#     return Densified(made, plan, empty_statistics(source.size), clone.size, split.size, (~alive).sum())
# ```
#
# <!-- definition: endotsr.definition.density_control.with_children -->
# ```python
# def with_children(gaussians, noise):
#     """Move the last Gaussians, copies of their parents, to samples of the parents and shrink them by 1.6.
#
#     noise (2, 3, splits) [child, axis, parent]: all first children come before all second ones.
#     """
#     noise = np.concatenate(noise, axis=1)
#     children = slice(gaussians.opacity_logit.size - noise.shape[1], None)
#     rotation = rotation_of(unit(gaussians.quaternion[:, children])[0])
#     position, log_scale = gaussians.position.copy(), gaussians.log_scale.copy()
#     axes = np.exp(np.clip(log_scale[:, children], -40, 40))
#     position[:, children] += np.einsum("ijn,jn->in", rotation, axes * noise)
#     log_scale[:, children] -= np.log(1.6)
#     return gaussians._replace(position=position, log_scale=log_scale)
# ```

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Set-up of the example", "code_prompt_hide": "Hide the set-up"}
N = 60
gaussians = Gaussians(
    position=np.vstack([rng.uniform(-2, 2, (2, N)), rng.uniform(4, 5, N)]),
    quaternion=rng.normal(size=(4, N)),
    log_scale=np.log(rng.uniform(0.04, 0.3, (3, N)) * np.where(np.arange(N) % 2, 1.0, 0.33)),
    opacity_logit=rng.uniform(-7, 2, N),
    harmonics=rng.normal(0, 0.5, (1, 3, N)),
)
gaussians.opacity_logit[0] = -5.2983  # an opacity of 0.00498: just below the bound
camera = Camera(np.eye(3), np.zeros(3), 40.0, 40.0, 32.0, 24.0, 64, 48)
scene = Scene(
    gaussians.position,
    gaussians.quaternion,
    gaussians.log_scale,
    gaussians.opacity_logit,
    gaussians.harmonics,
)
statistics, text = empty_statistics(N), definition_of_density.empty_statistics(N)
for _ in range(3):  # three views: a shifted camera, and a random pull on the image
    seen_from = camera._replace(translation=rng.normal(0, 0.2, 3))
    out, saved = render_forward(scene, seen_from, RASTER, degree=0)
    grads = render_reverse(rng.normal(0, 1e-5, out.colour.shape), 0 * out.depth, None, saved)
    gather_statistics(statistics, grads.d_mean2d, grads.visible, camera.width, camera.height)
    text = definition_of_density.gather_statistics(
        text, grads.d_mean2d, grads.visible, camera.width, camera.height
    )
steep = text.gradient_sum / np.maximum(text.visits, 1)
np.testing.assert_allclose(
    statistics.gradient_sum / np.maximum(statistics.visits, 1), steep, rtol=1e-12
)
d = PAPER.density
assert (d.gradient_threshold, d.prune_opacity, d.extent, d.dense_fraction, d.maximum) == (
    *(2e-4, 0.005, 10),
    *(0.01, 400_000),
), "the table"


def screen_gradients(size):
    """Norms in NDC and per pixel, for one smooth gradient image of a mean over pixels."""
    large = Camera(
        np.eye(3),
        np.zeros(3),
        40.0 * size,
        40.0 * size,
        32.0 * size,
        24.0 * size,
        64 * size,
        48 * size,
    )
    out, saved = render_forward(scene, large, EXACT, degree=0)
    v, u = np.mgrid[0 : large.height, 0 : large.width] + 0.5
    wave = np.cos(5 * u / large.width) * np.sin(4 * v / large.height + 1)
    back = np.broadcast_to(wave / out.colour.size, out.colour.shape).copy()
    g_u, g_v = render_reverse(back, 0 * out.depth, None, saved).d_mean2d
    return np.hypot(large.width / 2 * g_u, large.height / 2 * g_v), np.hypot(g_u, g_v)


(unit, per_pixel), (unit_2, per_pixel_2) = screen_gradients(4), screen_gradients(8)
print(f"twice the size: {np.median(unit_2 / unit):.2f} in these units, ", end="")
print(f"{np.median(per_pixel_2 / per_pixel):.2f} per pixel")
np.testing.assert_allclose(np.median(unit_2 / unit), 1, atol=0.1)
np.testing.assert_allclose(np.median(per_pixel_2 / per_pixel), 0.5, atol=0.05)
rule = DensityConfig(gradient_threshold=float(np.quantile(steep, 0.6)))
extent, p = 10.0, rule.dense_fraction
after = densify(gaussians, statistics, rule, np.random.default_rng(5), extent)
alive = 1 / (1 + np.exp(-gaussians.opacity_logit)) >= rule.prune_opacity
candidate = alive & (steep >= rule.gradient_threshold)
small = np.exp(gaussians.log_scale).max(axis=0) <= p * extent
to_clone, to_split = np.flatnonzero(candidate & small), np.flatnonzero(candidate & ~small)
survivors = np.flatnonzero(alive & ~np.isin(np.arange(N), to_split))

# %% [markdown]
# ### Figure: one step of density control

# %% tags=["hide-input"]
figure, axes = plt.subplots(1, 2, figsize=(8, 3.7), layout="constrained")
circle = np.stack(
    [np.cos(np.linspace(0, 2 * np.pi, 40)), np.sin(np.linspace(0, 2 * np.pi, 40))]
)


def outlines(panel, some, colours):
    shape, _ = covariance_forward(some.quaternion, some.log_scale)
    factor = shape.rotation * shape.scale
    for i, colour in enumerate(colours):
        flat = np.linalg.cholesky(factor[:2, :, i] @ factor[:2, :, i].T)
        panel.plot(*(1.5 * flat @ circle + some.position[:2, i : i + 1]), color=colour, lw=1.3)


before = np.full(N, "0.75", dtype=object)
before[~alive], before[to_clone], before[to_split] = "k", "tab:blue", "tab:red"
outlines(axes[0], gaussians, before)
now = ["0.75"] * len(survivors) + ["tab:blue"] * len(to_clone) + ["tab:red"] * 2 * len(to_split)
outlines(axes[1], after.gaussians, now)
axes[0].set_title(f"before: {N}. black: to prune, blue: to clone,\nred: to split", fontsize=10)
axes[1].set_title(
    f"after: {after.gaussians.count}. blue: clones (on their parents),\nred: children",
    fontsize=10,
)
for panel in axes:
    panel.set(xlim=(-2.7, 2.7), ylim=(-2.5, 2.5), aspect="equal", xticks=[], yticks=[])
plt.show()

# %%
assert (after.pruned, after.cloned, after.split) == (
    np.sum(~alive),
    len(to_clone),
    len(to_split),
)
assert min(after.pruned, after.cloned, after.split) > 0, "the example shows all three"
adam = adam_state(arrays(gaussians))
adam.first["position"] += np.arange(1.0, N + 1)
# Moments follow; fresh ones start at 0.
regather(adam, arrays(gaussians), after.plan.source, after.plan.survivors)
np.testing.assert_array_equal(
    adam.first["position"][0],
    [*(survivors + 1.0), *np.zeros(len(to_clone) + 2 * len(to_split))],
)
np.testing.assert_array_equal(
    after.gaussians.position[:, : len(survivors)], gaussians.position[:, survivors]
)
np.testing.assert_array_equal(
    after.gaussians.position[:, len(survivors) :][:, : len(to_clone)],
    gaussians.position[:, to_clone],
)
made = definition_of_density.densify(
    gaussians, statistics, rule, np.random.default_rng(5), extent
)
np.testing.assert_array_equal(after.plan.source, made.plan.source)
for name in ("position", "quaternion", "log_scale", "opacity_logit", "harmonics"):
    found, expected = getattr(after.gaussians, name), getattr(made.gaussians, name)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
children = after.gaussians.log_scale[:, -2 * len(to_split) :]
parents = np.tile(gaussians.log_scale[:, to_split], 2)
np.testing.assert_allclose(children, parents - np.log(1.6), rtol=1e-12)

# %% [markdown]
# The next cells check (13.7) to (13.10). The first compares the new order and the table of (13.8) with the code, and
# the threshold at equality.

# %%
source, stay = after.plan.source, after.plan.survivors
np.testing.assert_array_equal(source, [*survivors, *to_clone, *to_split, *to_split])
for name in ("quaternion", "opacity_logit", "harmonics"):
    of_parent = getattr(gaussians, name)[..., source]
    np.testing.assert_array_equal(getattr(after.gaussians, name), of_parent, name)
of_time = ("fdm_weight", "fdm_centre", "fdm_width")
of_time += ("appearance_coefficients", "motion_coefficients")
numbers = np.random.default_rng(13).normal(size=(10, 4, N))
rows = (10, 10, 10, 3, 3)
moving = gaussians._replace(**{name: k * numbers[:k] for name, k in zip(of_time, rows)})
grown = densify(moving, statistics, rule, np.random.default_rng(5), extent).gaussians
for name in of_time:
    np.testing.assert_array_equal(
        getattr(grown, name), getattr(moving, name)[..., source], name
    )
clones = slice(stay, stay + len(to_clone))
np.testing.assert_array_equal(
    after.gaussians.log_scale[:, clones], gaussians.log_scale[:, to_clone]
)

mean_gradient = statistics.gradient_sum / np.maximum(statistics.visits, 1)
third = float(np.sort(mean_gradient[alive])[-3])
for threshold, count in ((third, 3), (np.nextafter(third, np.inf), 2)):
    at_third = msgspec.structs.replace(rule, gradient_threshold=float(threshold))
    grown_at = densify(gaussians, statistics, at_third, np.random.default_rng(5), extent)
    assert grown_at.cloned + grown_at.split == count, "the threshold itself is reached"

# %% [markdown]
# The second writes (13.8) once more, with the draws of the same generator. It then checks the room of (13.7), the
# covariance of (13.9) and the two statements of (13.10).

# %%
xi = np.random.default_rng(5).standard_normal((2, 3, len(to_split)))
form, _ = covariance_forward(
    gaussians.quaternion[:, to_split], gaussians.log_scale[:, to_split]
)
drawn = [np.einsum("jkn,kn->jn", form.rotation, form.scale * one) for one in xi]
expected = np.hstack([gaussians.position[:, to_split] + offset for offset in drawn])
np.testing.assert_allclose(
    after.gaussians.position[:, -2 * len(to_split) :], expected, rtol=1e-12
)

room = 3
full = msgspec.structs.replace(rule, maximum=int(alive.sum()) + room)
crowded = densify(gaussians, statistics, full, np.random.default_rng(5), extent)
grown = np.setdiff1d(np.flatnonzero(candidate), np.argsort(-steep * candidate)[room:])
np.testing.assert_array_equal(
    np.unique(crowded.plan.source[crowded.plan.survivors :]), grown, "the steepest three"
)
assert crowded.gaussians.count == alive.sum() + room

one_Sigma = form.rotation[:, :, 0] * form.scale[:, 0] ** 2 @ form.rotation[:, :, 0].T
factor = np.linalg.cholesky(one_Sigma)
pairs = factor @ np.random.default_rng(6).standard_normal(
    (20_000, 2, 3, 1)
)  # children of one parent
spread = pairs - pairs.mean(axis=1, keepdims=True)
pair = (spread @ spread.swapaxes(2, 3)).mean(axis=(0, 1)) + one_Sigma / 1.6**2
np.testing.assert_allclose(pair, 0.89 * one_Sigma, atol=0.02 * one_Sigma.max())

front = to_clone[:1]
alone, twice = (
    Scene(*(array if array is None else array[..., some] for array in scene))
    for some in (front, np.repeat(front, 2))
)
once, doubled = (render_forward(s, camera, EXACT, degree=0)[0].opacity for s in (alone, twice))
np.testing.assert_allclose(doubled, 1 - (1 - once) ** 2, atol=1e-12)
assert doubled.max() > once.max() > 0.1
moved = np.zeros(2)  # the same gradient; the first has moments, the clone has none
adam_step(moved, np.ones(2), np.array([0.5, 0]), np.array([0.5, 0]), 600, 0.01, *constants)
assert abs(moved[0] - moved[1]) > 1e-3

# %% [markdown]
# ### Figure: growth of the running clip
#
# The preset `quick` replaces the threshold by a budget: every run of density control adds the steepest candidates, in
# about equal parts until the budget is reached ({doc}`20_first_look`). The left panel shows the number of
# Gaussians of the running clip, whose budget is 22000. Where would the next ones be added? The statistic needs many
# views. The right panel has one, the held-out frame, and marks the steepest twentieth of the Gaussians. The middle
# panel shows the error of the render.

# %% tags=["hide-input"]
clip = load()
out, saved = render_forward(clip.scene, clip.camera, RASTER, degree=0)
w = clip.config.loss.ssim_weight
photometric, l1_saved = masked_l1_forward(out.colour, clip.image.astype(np.float32), clip.mask)
similarity = masked_ssim_forward(
    out.colour, ssim_target(clip.image.astype(np.float32), clip.mask)
)
pull = masked_l1_reverse(1 - w, l1_saved) + masked_ssim_reverse(-w, similarity[1])
of_view = render_reverse(pull, 0 * out.depth, None, saved)
one_view = empty_statistics(len(clip.scene.opacity_logit))
width, height = clip.camera.width, clip.camera.height
gather_statistics(one_view, of_view.d_mean2d, of_view.visible, width, height)
steepest = one_view.gradient_sum >= np.quantile(one_view.gradient_sum, 0.95)
error = np.where(clip.mask, np.abs(out.colour - clip.image).mean(axis=0), np.nan)

figure, axes = plt.subplots(
    1, 3, figsize=(10.9, 3.3), layout="constrained", width_ratios=[1, 1.1, 1.1]
)
growth = clip.about["growth"]
axes[0].plot(100 * np.arange(len(growth)), growth, "o-", color="#0072B2", ms=4)
axes[0].set(title="Gaussians", xlabel="iteration")
shown = axes[1].imshow(error, vmin=0, vmax=0.1, cmap="magma")
axes[1].set_title("error of the render")
axes[2].plot(*saved.projected.mean2d[:, steepest], ".", color="#D55E00", ms=1.5)
axes[2].set(xlim=(0, width), ylim=(height, 0), aspect="equal", title="steepest twentieth")
for panel in axes[1:]:
    panel.set(xticks=[], yticks=[])
plt.show()

columns, rows = np.clip(saved.projected.mean2d, 0, [[width - 1], [height - 1]]).astype(int)
around = uniform_filter(np.nan_to_num(error), 9)[rows, columns]
seen_there = clip.mask[rows, columns]
ratio = around[steepest & seen_there].mean() / around[~steepest & seen_there].mean()
print(f"error around the steepest: {ratio:.2f} times that around the others")
assert ratio > 1.2 and growth[-1] == clip.about["gaussians"]
assert np.diff(growth).max() < 1.02 * np.diff(growth)[np.diff(growth) > 0].min()

# %% [markdown]
# At the centres of the steepest Gaussians the true picture is steeper on average, as it is along vessels and around
# highlights, where a shift of a Gaussian changes the picture.

# %%
steepness = np.where(
    clip.mask, np.hypot(*np.gradient(clip.image.mean(axis=0).astype(float))), np.nan
)
at = steepness[rows, columns]
times = np.nanmean(at[steepest]) / np.nanmean(at[~steepest])
print(f"gradient of the picture at the steepest: {times:.2f} times that at the others")
assert times > 1.2

# %% [markdown]
# ## The reverse pass
#
# Adam and density control are not differentiated; they **use** gradients. The screen gradients $g_u,g_v$ are results
# of the reverse pass of compositing, before the reverse pass of the projection. The pair to check is therefore the
# pair of {doc}`09_compositing`, block `mean2d`.

# %%
with one_thread():
    report = check_pair(all_pairs()["composite_paper"], pair_stream("composite_paper", 1))
print(table([report]))
assert report.passed

# %% [markdown]
# ## Exercise
#
# 1. A Gaussian of opacity 0.5 covers a region that one Gaussian explains well. Its screen gradient has a random sign
#    in every view. Is $\bar g_i$ small or large? Compare it with the norm of the mean gradient.
# 2. Write `adam_step`, and let the golden cases judge it: `--only adam` ({doc}`index`). Then write `densify`:
#    `--only density`. The case `on_the_thresholds` decides between $<$ and $\le$.
# 3. The cell below answers this one. A new Gaussian has $m=v=0$, but the step count $k$ belongs to the array and
#    continues. Use (13.2) to predict the first update of a child added at $k=600$: is it larger or smaller than
#    $\eta$, and by what factor? What is the factor when the count is very large?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. 2.1 eta, and 3.16 eta in the limit: m is 0.1 g, sqrt(v) is 0.0316 g, and bias
# correction no longer compensates.
for k, factor in ((600, 2.13), (10**6, 3.162)):
    p = np.zeros(1)
    adam_step(p, np.ones(1), np.zeros(1), np.zeros(1), k, 1.0, *constants)
    print(k, -p[0])
    np.testing.assert_allclose(-p[0], factor, rtol=2e-2)
assert isinstance(after.statistics, DensityStatistics) and not after.statistics.visits.any()
