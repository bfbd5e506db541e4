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
# # 3. The simulated scene, and where the Gaussians start
#
# For a real sequence the true motion, the true depth behind the instrument and the true light are unknown. The
# simulator provides them: it renders a sheet of tissue given by a formula, under an endoscope, and each effect has a
# switch.
#
# The second half of this chapter shows how the first Gaussians are made. It names the projection, the colour and the
# opacity of a Gaussian, the subjects of chapters 7 to 9. A first reading can leave it out and return to it before
# {doc}`13_optimiser_and_density`.
#
# The equation is {eq}`eq-b12` of {doc}`/specification/b12_initialisation`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import os

import matplotlib.pyplot as plt
import numpy as np

from endotsr.clips.simulator import EFFECTS, SimulatorSettings, simulate, with_effects
from endotsr.config import InitialisationConfig, ModelConfig
from endotsr.definition import initialisation as definition
from endotsr.method.splatting.camera import backproject
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.training.scene.initialisation import Y00, gaussians_at, initialise

# %%
SMALL = os.environ.get("ENDOTSR_NOTEBOOK_SIZE") == "small"
settings = SimulatorSettings(width=64, height=51, frames=12) if SMALL else SimulatorSettings()
simulated = simulate(settings)
sequence, truth = simulated.sequence, simulated.truth
camera = sequence.cameras[0]

# %% [markdown]
# ## The sheet
#
# The world has the axes of the camera at rest: $x$ to the right, $y$ down and $z$ forward. A material point of the sheet
# has two coordinates $(a,b)$ in millimetres. At time $t$ it is at
# $X(a,b,t)=\bigl(a,\ b,\ \mathrm{distance}+h(a,b)\bigr)+\sum_k s_k(t)\,w_k(a,b)\,\mathbf v_k$. Here *distance* is that
# from the camera to the middle of the tissue, and $h$ is a sum of plane waves. The motions $k$ are the breathing, the
# beat and the pull. Each has a time course $s_k$ with $s_k(0)=0$, a spatial weight $w_k$ and a direction $\mathbf v_k$.
#
# A pixel shows the material point that its ray meets. Newton's method finds this point, to $10^{-10}$ mm from the ray.
# In the transcription below, `weight` returns three arrays: the weight and its derivatives with respect to $a$ and $b$.


# %% tags=["transcription"]
def sheet_text(surface, a, b, t):
    h = sum(
        A * np.sin(k_a * a + k_b * b + phase)
        for A, (k_a, k_b), phase in zip(surface.amplitude, surface.wave.T, surface.phase)
    )
    X = np.stack([a, b, surface.distance + h])
    for motion in surface.motions:
        X = X + motion.course(t) * motion.weight(a, b)[0] * motion.direction.reshape(
            3, *[1] * a.ndim
        )
    return X


def breathing_text(part, t):
    return part.amplitude * np.sin(np.pi * part.cycles * t) ** 2


# %%
for index in (0, 5, 11):
    t = float(sequence.times[index])
    a, b = truth.material_coordinates[index]
    X = sheet_text(truth.surface, a, b, t)
    np.testing.assert_allclose(
        simulated.surface_point(truth.material_coordinates[index], t), X, rtol=1e-12, atol=1e-12
    )
    # The camera rests at the origin.
    np.testing.assert_allclose(truth.depth[index], X[2], rtol=1e-12)
    u = camera.fx * X[0] / X[2] + camera.cx
    off = (u - (np.arange(camera.width) + 0.5)) * X[2] / camera.fx
    assert np.abs(off).max() < 1e-10, "mm beside the ray through the pixel centre"
    np.testing.assert_allclose(
        truth.surface.motions[0].course(t), breathing_text(settings.breathing, t), rtol=1e-12
    )

# %% [markdown]
# ## Each effect is a switch
#
# With all effects off, all frames are equal. With one effect on, the difference between two frames is that effect
# alone. The figure shows the first ten effects of `EFFECTS`. Noise, instrument and highlights are shown as a frame, and
# the errors of the depth as the prior depth. The other panels are differences of brightness between two frames, from -60
# (blue) to 60 (red) of 255 levels.

# %% tags=["hide-input"]
tiny = SimulatorSettings(width=64, height=51, frames=8)
frozen = simulate(with_effects(tiny)).sequence
assert (frozen.images == frozen.images[0]).all() and frozen.masks.all()

figure, axes = plt.subplots(2, 5, figsize=(10.9, 4.1), layout="constrained")
for panel, effect in zip(axes.flat, EFFECTS):
    single = simulate(with_effects(tiny, effect)).sequence
    if effect in ("noise", "instrument", "highlights"):
        picture, title = single.images[3].transpose(1, 2, 0), effect
        panel.imshow(picture)
    elif effect == "depth_errors":
        panel.imshow(np.where(single.depth[3] > 0, single.depth[3], np.nan), cmap="viridis")
        title = "depth_errors (prior)"
    else:
        change = single.images[3].astype(float).mean(axis=0) - single.images[0].mean(axis=0)
        assert np.abs(change).max() > 5, effect
        panel.imshow(change, cmap="RdBu_r", vmin=-60, vmax=60)
        title = f"{effect}: frame 3 - frame 0"
    panel.set_title(title, fontsize=10)
    panel.set(xticks=[], yticks=[])
plt.show()

# %% [markdown]
# ## Figure: frames, true depth, true motion
#
# Optical flow methods estimate the flow; here it is known, also behind the instrument. The lower right panel follows
# single points over the clip. Breathing moves all of them; the beat and the pull move the points near their centres.

# %% tags=["hide-input"]
figure, axes = plt.subplots(2, 4, figsize=(10.9, 4.8), layout="constrained")
middle = sequence.count // 2
for panel, index in zip(axes[0], np.linspace(0, sequence.count - 1, 4).astype(int)):
    panel.imshow(sequence.images[index].transpose(1, 2, 0))
    panel.set_title(
        f"frame {index}, t = {sequence.times[index]:.2f}"
        + (" (held out)" if index in sequence.test_index else "")
    )
axes[1, 0].imshow(truth.depth[middle], cmap="viridis")
axes[1, 0].set_title(
    f"true depth, {truth.depth[middle].min():.0f} to {truth.depth[middle].max():.0f} mm"
)
axes[1, 1].imshow(
    np.where(sequence.depth[middle] > 0, sequence.depth[middle], np.nan), cmap="viridis"
)
axes[1, 1].set_title("depth prior (none under the tool)")
flow = simulated.true_flow(0, middle)
axes[1, 2].imshow(np.hypot(*flow), cmap="magma")
step = max(4, camera.width // 14)
rows, columns = np.mgrid[step // 2 : camera.height : step, step // 2 : camera.width : step]
axes[1, 2].quiver(
    columns,
    rows,
    *flow[:, rows, columns],
    color="w",
    angles="xy",
    scale_units="xy",
    scale=1,
    width=0.006,
)
axes[1, 2].set_title(f"true flow from frame 0, up to {np.hypot(*flow).max():.1f} px")
times = np.linspace(0, 1, 200)
for (a, b), label in (
    ((-10.0, 5.0), "on the beat"),
    ((3.0, 2.0), "on the pull"),
    ((-25.0, -20.0), "breathing only"),
):
    heights = [-simulated.surface_point(np.array([a, b]), t)[2] for t in times]
    axes[1, 3].plot(times, np.array(heights) - heights[0], label=label)
breath, *others = [motion.weight(-25.0, -20.0)[0] for motion in truth.surface.motions]
assert breath > 0.5 and max(others) < 0.01, "breathing only"
axes[1, 3].set(title="lift towards the camera [mm]", xlabel="t")
axes[1, 3].legend()
for panel in axes.flat[:-1]:
    panel.set(xticks=[], yticks=[])
plt.show()

# %% [markdown]
# ## Where Gaussians start
#
# The first Gaussians should show the first frame roughly, so that gradients begin near the tissue. Each pixel that is
# drawn in a training frame becomes one Gaussian.
#
# **Which pixels are drawn.** The mask $M_k$ of frame $k$ is true on tissue, and its prior depth $D_k$ is 0 where there
# is none. (The reader of a recorded clip has clipped the depths of each frame to their percentiles 3 and 99.8.) In the
# first training frame, which has the index 0 here, the candidates are the tissue pixels with depth.
# `initialisation.first_frame_points` of them are drawn at random, without replacement. In another training frame, a
# tissue pixel with depth is a candidate if the first frame has no tissue with depth there, or if the depth has changed
# by more than $\tau$, which is `initialisation.motion_threshold`:
#
# $$
# M_k\wedge(D_k>0)\wedge\Bigl(\neg\,(M_0\wedge D_0>0)\ \vee\ |D_k-D_0|>\tau\Bigr)
# $$
#
# Each of these frames adds `initialisation.other_frame_points` divided by the number of frames of the clip, held-out
# frames included, and rounded down. The preset `paper` has the numbers 35 000 and 5000, and $\tau=40$ scene units. If a
# frame has fewer candidates than that, all of them are used. In clips of more than 150 frames, the other training frames
# at an even distance from the first one are left out.
#
# <!-- definition: endotsr.definition.initialisation.drawn_pixels -->
# ```python
# def drawn_pixels(sequence, config, rng):
#     """(frame, flat indices): pixels of the first training frame, then new or moved pixels of the others, ascending.
#
#     Draws: one `rng.choice` in each frame with more of these pixels than are wanted.
#     """
#     usable = sequence.masks & (sequence.depth > 0) & np.isfinite(sequence.depth)
#     first, count = sequence.train_index[0], len(sequence.images)
#     for k in sequence.train_index:
#         if k > first and count > 150 and (k - first) % 2 == 0:  # a long clip: every second frame
#             continue
#         with np.errstate(invalid="ignore"):
#             moved = np.abs(sequence.depth[k] - sequence.depth[first]) > config.motion_threshold
#         wanted = np.flatnonzero(usable[k] & ((k == first) | ~usable[first] | moved))
#         number = config.first_frame_points if k == first else config.other_frame_points // count
#         yield k, wanted if wanted.size <= number else np.sort(rng.choice(wanted, number, replace=False))
# ```
#
# Let $(i,j)$ be a drawn pixel, with column $i$ and row $j$ counted from 0, and let $D$ be its depth.
#
# **(3.1) The ray.** The projection of chapter 7 has $u=f_xx/z+c_x$. A pixel is sampled at its centre, $u=i+\frac12$,
# and its depth is $z=D$, so $x=(i+\frac12-c_x)\,D/f_x$, and in the same way for $y$.
#
# **(3.2) Into the world.** The camera has $(x,y,z)^\top=W\mu+\mathbf d$. $W$ is a rotation, so its inverse is $W^\top$:
#
# $$
# \mu=W^\top\left(\begin{bmatrix}(i+\tfrac12-c_x)\,D/f_x\\(j+\tfrac12-c_y)\,D/f_y\\D\end{bmatrix}-\mathbf d\right)
# $$
#
# **(3.3) Colour.** The harmonics above degree 0 start at 0, so the displayed colour is $rgb=Y_{00}h_0+\frac12$ and
# $h_0=(rgb-\frac12)/Y_{00}$ with $Y_{00}=1/\sqrt{4\pi}$. The colours of a frame are its 8-bit values divided by 255.
#
# **(3.4) Size.** All three semi-axes are the root mean square distance to the three nearest other points, so
# near neighbours overlap. Points may coincide; if all three distances are 0, the floor keeps the logarithm finite:
# $s=\ln\sqrt{\max(\overline{d^2},10^{-7})}$. With fewer than four points the mean is over the others that exist, and a
# single point has the floor. A sphere needs no rotation, and the quaternion starts at $(1,0,0,0)$.
#
# **(3.5) Opacity** starts at 0.1. By (9.3) the gradient of a Gaussian is proportional to the light that reaches it. If
# all Gaussians started opaque, those behind the first would have almost none.
#
# **(3.6) Motion.** The weights of the time bases start at 0, their centres are evenly spaced from 0 to 1, and their
# widths are `model.initial_width`, 0.01 in `paper`. With the weights 0 the scene is at rest.
# By (4.1) the gradient with respect to the weight of a basis near the time of a frame is not 0 there, so motion can be
# learned.


# %% tags=["transcription"]
def lift_text(i, j, D, camera):
    in_camera = np.array(
        [(i + 1 / 2 - camera.cx) * D / camera.fx, (j + 1 / 2 - camera.cy) * D / camera.fy, D]
    )
    return camera.rotation.T @ (in_camera - camera.translation)


def log_scale_text(positions):
    distance = ((positions[:, :, None] - positions[:, None, :]) ** 2).sum(axis=0)
    three = np.sort(distance, axis=1)[:, 1:4]
    return np.log(np.sqrt(np.maximum(three.mean(axis=1), 1e-7)))


# %%
j, i = np.mgrid[0 : camera.height, 0 : camera.width]
lifted = backproject(
    camera, i.ravel().astype(float), j.ravel().astype(float), truth.depth[0].ravel()
)
np.testing.assert_allclose(
    lifted[:, 777],
    lift_text(i.flat[777], j.flat[777], truth.depth[0].flat[777], camera),
    rtol=1e-13,
)
# projecting and lifting are inverse to each other, and the lifted depth is the sheet itself:
np.testing.assert_allclose(
    lifted,
    simulated.surface_point(truth.material_coordinates[0].reshape(2, -1), 0.0),
    atol=1e-8,
)
turned = simulate(with_effects(tiny, "camera_motion")).sequence.cameras[3]
np.testing.assert_allclose(
    backproject(turned, np.array([7.0]), np.array([9.0]), np.array([50.0]))[:, 0],
    lift_text(7, 9, 50.0, turned),
    rtol=1e-13,
)

drawing = InitialisationConfig(
    first_frame_points=400, other_frame_points=600, motion_threshold=1.0
)
start = initialise(sequence, drawing, ModelConfig(), np.random.default_rng(0), np.float64)
assert start.opacity_logit.size > 400, "other frames add points"
text = definition.initialise(sequence, drawing, ModelConfig(), np.random.default_rng(0))
for name, expected in text._asdict().items():
    if expected is not None:
        found = getattr(start, name)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12, err_msg=name)
np.testing.assert_allclose(
    start.log_scale, np.tile(log_scale_text(start.position), (3, 1)), rtol=1e-9, atol=1e-12
)
np.testing.assert_allclose(1 / (1 + np.exp(-start.opacity_logit)), 0.1, rtol=1e-12)
colour = start.harmonics[0] * Y00 + 0.5
assert colour.min() >= 0 and colour.max() <= 1 and not np.any(start.fdm_weight)

# %% [markdown]
# ## The reverse pass
#
# Initialisation is not differentiated. Back-projection and projection use the same rule for pixel centres, as the cells
# above assert. The half pixel of this rule is a constant and drops out of the derivatives. The pair to check is that of
# the projection, whose inverse (3.1) and (3.2) are.

# %%
with one_thread():
    report = check_pair(all_pairs()["projection_paper"], pair_stream("projection_paper", 2))
print(table([report]))
assert report.passed

# %% [markdown]
# ## Exercise
#
# 1. Why can no Gaussian start at a pixel without prior depth? What follows for tissue under an instrument?
# 2. Write `initialise` for given draws and let the golden cases judge it: `--only initialisation` ({doc}`index`). The
#    case `one_point` has no neighbour from which a scale could be made.
# 3. The cell below answers this one. Once a clip is read, no picture, mask or depth of a held-out frame contributes to
#    the initial Gaussians; {doc}`/specification/b12_initialisation` says what has an effect before. How would you test
#    whether that is true of a program whose source you cannot read?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. Change the held-out frames arbitrarily; the result must stay bitwise equal.
import dataclasses

spoiled = dataclasses.replace(
    sequence,
    images=sequence.images.copy(),
    depth=sequence.depth.copy(),
    masks=sequence.masks.copy(),
)
spoiled.images[sequence.test_index] = 7
spoiled.depth[sequence.test_index] = 1e6
spoiled.masks[sequence.test_index] ^= True
few = InitialisationConfig(first_frame_points=300, other_frame_points=600, motion_threshold=1.0)
one, other = (
    initialise(s, few, ModelConfig(), np.random.default_rng(3)) for s in (sequence, spoiled)
)
assert all(np.array_equal(x, y) for x, y in zip(one[:8], other[:8]))
# A single point gets the floor.
lone = gaussians_at(np.zeros((3, 1)), np.full((3, 1), 0.5), ModelConfig(), np.float64)
np.testing.assert_allclose(lone.log_scale, np.log(np.sqrt(1e-7)))
