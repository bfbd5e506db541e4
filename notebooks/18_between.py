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
# # 18. Targets between the frames
#
# Apart from chapter 14, which trains its full sequence with the targets of this chapter, every loss on images so far is
# computed at the time of a training frame, and none reads a render between two of them. In {doc}`00_why` a clip
# breathes four times. There the colour residual gains on the training frames and loses on the held-out frames. The
# preset `sharp` therefore also renders times between the frames. It compares these renders with targets that are made
# from both frames, moved along their optical flow.
#
# The equation is {eq}`eq-b14` of {doc}`/specification/b14_between`. It is optional and not in the paper.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import msgspec
import numpy as np

import endotsr
from endotsr.clips.flow import between as definition
from endotsr.clips.flow.between import (
    Flows,
    flows_between,
    frame_between,
    gap_between,
    motion_between,
)
from endotsr.clips.opencv.flow import warp_cubic
from endotsr.clips.simulator import SimulatorSettings, simulate, with_effects
from endotsr.clips.simulator.scenes import named_scene
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.results.evaluation.trajectories import trajectory_error

# %% [markdown]
# ## The problem
#
# The clip is the one of {doc}`00_why` that breathes four times: 24 frames, of which three are held out. It is trained
# twice with the preset `paper`, shortened. The first run is unchanged. In the second, 70 %<!--=sharp.bridged--> of the
# iterations are at times between the frames, which is the fraction of `sharp`. The simulator also renders the true
# picture at three times between any two frames. Sketch the PSNR over time of both runs before you look at the figure:
# where are its peaks?

# %%
FRAMES, MOMENTS, ITERATIONS = 24, 4, 500
replace = msgspec.structs.replace


def breathing(frames, noise):
    plain = SimulatorSettings(width=96, height=76, frames=frames)
    settings = with_effects(plain, "breathing", *noise)
    return simulate(replace(settings, breathing=replace(settings.breathing, cycles=4.0)))


clip, truth = breathing(FRAMES, ("noise",)), breathing(MOMENTS * FRAMES, ()).sequence
runs = {
    name: endotsr.train(
        clip.sequence,
        preset="paper",
        iterations=ITERATIONS,
        initialisation={"first_frame_points": 3000, "other_frame_points": 750},
        training={"seed": 0, "threads": 1, "bridge_fraction": fraction},
        on_message=lambda line: None,
    )
    for name, fraction in (("frames alone", 0.0), ("frames and targets", 0.7))
}

# %% tags=["hide-input"]
times = truth.times[: 1 - MOMENTS]
everywhere = np.ones((truth.height, truth.width), bool)
course = {
    name: [
        psnr_tissue(
            np.clip(run.render(float(t), 0).colour, 0, 1), truth.images[k] / 255, everywhere
        )
        for k, t in enumerate(times)
    ]
    for name, run in runs.items()
}
figure, axis = plt.subplots(figsize=(10.1, 2.9), layout="constrained")
for (name, values), colour in zip(course.items(), ("tab:red", "tab:blue")):
    axis.plot(times, values, color=colour, lw=1.2, label=name)
    at_frames = np.array(values)[MOMENTS * clip.sequence.train_index]
    axis.plot(clip.sequence.times[clip.sequence.train_index], at_frames, ".", color=colour)
for k, t in enumerate(clip.sequence.times[clip.sequence.test_index]):
    axis.axvline(t, color="0.85", lw=6, zorder=0, label="held out" if k == 0 else None)
axis.set(xlabel="t", ylabel="PSNR against the true picture, dB", title="dots: training frames")
axis.legend(ncols=3)
plt.show()
places = {
    "at training frames": MOMENTS * clip.sequence.train_index,
    "between two of them": np.setdiff1d(
        np.arange(len(times)), MOMENTS * clip.sequence.train_index
    ),
    "at held-out frames": MOMENTS * clip.sequence.test_index,
}
mean = {(n, p): np.mean(np.array(course[n])[k]) for n in runs for p, k in places.items()}
for name in runs:
    print(f"{name:20s}", ", ".join(f"{mean[name, place]:.1f} dB {place}" for place in places))
alone, both = runs
assert mean[alone, "at held-out frames"] < mean[alone, "at training frames"] - 4
assert mean[both, "at held-out frames"] > mean[alone, "at held-out frames"] + 3
assert mean[both, "between two of them"] > mean[alone, "between two of them"] + 0.5
lost = mean[alone, "at training frames"] - mean[both, "at training frames"]
assert 0.3 < lost < 1, "less than a decibel"
worst = {name: int(np.argmin(values)) for name, values in course.items()}
gap = MOMENTS * clip.sequence.test_index
assert min(abs(gap - worst[alone])) < MOMENTS, "the worst time is beside a held-out frame"
near = np.abs(np.arange(len(times))[:, None] - gap).min(axis=1) < MOMENTS
values = np.array(course[alone])
assert max(values[near & (abs(np.arange(len(times)) - k) < MOMENTS)].min() for k in gap) < min(
    values[~near]
), "every wide gap has a time that is worse than all times outside the wide gaps"
inner = MOMENTS * clip.sequence.train_index[1:-1]
peaks = (values[inner] > values[inner - 1]) & (values[inner] > values[inner + 1])
print(f"the PSNR has a peak at {peaks.mean():.0%} of the training frames")
assert 0.6 < peaks.mean() < 1, "most of them"
swing = {name: np.ptp(values) for name, values in course.items()}
print("from the worst to the best time:", {name: f"{v:.1f} dB" for name, v in swing.items()})
assert swing[both] < swing[alone] - 2

# %% [markdown]
# If the model is trained only on frames, its PSNR has a peak at most training times. It is lowest near the held-out
# frames, where the gap is twice as wide. With targets it still varies, but less: the training frames lose less than a
# decibel, and the held-out frames gain more than that.
#
# ## The equation
#
# | Symbol | Meaning |
# |---|---|
# | $I_0,I_1$; $M_0,M_1$ | two successive training frames; their masks, true on tissue |
# | $f$, $g$ | optical flow from $I_0$ to $I_1$, and from $I_1$ to $I_0$, in px |
# | $a\in(0,1)$ | the intermediate time, as a fraction of the gap |
# | $v$ | motion field at time $a$: the displacement from $I_0$ to $I_1$ of the point at a pixel |
# | $J_0,J_1$ | both frames, moved to time $a$: the *moved pair*; $I_0,I_1$ are the *static pair* |
# | $e_{\mathrm m},e_{\mathrm s}$ | local mean squared difference of the moved and of the static pair |
# | $G_2*$ | average with a Gaussian window of 2 px<!--=between.window--> |
# | $q$ | fraction of the static pair in the target |
# | $I_a,M_a$ | the target and its mask |
#
# $$
# \begin{aligned}
# v_0(x)&=f\bigl(x-a\,v_0(x)\bigr),\qquad v_1(x)=-g\bigl(x+(1-a)\,v_1(x)\bigr),\\
# v&=(1-a)\,v_0+a\,v_1,\\
# J_0(x)&=I_0\bigl(x-a\,v(x)\bigr),\qquad J_1(x)=I_1\bigl(x+(1-a)\,v(x)\bigr),\\
# e_{\mathrm m}&=G_2*\operatorname{mean}_c(J_0-J_1)^2+255^{-2},\\
# e_{\mathrm s}&=G_2*\operatorname{mean}_c(I_0-I_1)^2+255^{-2},\qquad q=\frac{e_{\mathrm m}}{e_{\mathrm m}+e_{\mathrm s}},\\
# I_a&=(1-q)\bigl[(1-a)\,J_0+a\,J_1\bigr]+q\,\bigl[(1-a)\,I_0+a\,I_1\bigr],\\
# M_a(x)&=M_0\bigl(x-a\,v(x)\bigr)\vee M_1\bigl(x+(1-a)\,v(x)\bigr).
# \end{aligned}
# $$
#
# ## Step by step
#
# A flow gives the motion of the points of a *frame*. A target needs the point that is at a pixel at a *time* without a
# frame.
#
# **(18.1) The path of a point.** We assume that a point moves along a straight line at constant speed between two
# frames, by $v$ in total. If it is at $x$ at time $a$, it is at $x-av$ in $I_0$ and at $x+(1-a)v$ in $I_1$.
#
# **(18.2) The forward flow** at the place in $I_0$ is the whole displacement: $v=f(x-av)$. The unknown $v$ is on both
# sides, because the place at which the flow is read depends on $v$ itself.
#
# **(18.3) The backward flow** at the place in $I_1$ leads back to $I_0$, which gives a second equation:
# $v=-g(x+(1-a)v)$.
#
# **(18.4) Three steps of a fixed-point iteration** approximate the solution of each equation. For the first, start from
# $v^{(0)}=f(x)$ and repeat $v^{(k+1)}=f(x-av^{(k)})$. If $|f(x)-f(y)|\le L\,|x-y|$ for any two positions $x$ and $y$,
# then $|v^{(k+1)}-v|\le aL\,|v^{(k)}-v|$: if $aL<1$, every step reduces the error at least by the factor $aL$. Along a
# line, tissue that neither folds nor stretches to twice its length has $L<1$, and then $aL<1$ at every $a$. In a
# picture, a turn counts as well: a turn by the angle $\vartheta$ has $L=2\sin\frac\vartheta2$, which is below 1 for
# less than $60^\circ$. The start has the error $|f(x)-f(x-av)|\le aL\,|v|$, so three steps leave at most $(aL)^4|v|$.
#
# **(18.5) Which of the two.** The solutions $v_0$ of (18.2) and $v_1$ of (18.3) are read at different places: $v_0$ at
# the distance $a|v|$ from $x$, and $v_1$ at the distance $(1-a)|v|$. The nearer one has the larger weight:
# $v=(1-a)v_0+av_1$. This rule treats both frames alike. If the frames are exchanged and $a$ is replaced by $1-a$, then
# $f$ and $g$ change places, $v_0$ becomes $-v_1$, and $v$ changes its sign only.
#
# **(18.6) The moved pair.** If the flow is right, $J_0$ and $J_1$ are two pictures of the same point. They then differ
# by noise, by a change of light and by the interpolation. Their blend has less noise than a frame: at whole pixels its
# variance is $\bigl((1-a)^2+a^2\bigr)\sigma^2$, half the variance of a frame at $a=\frac12$. Between pixels the
# interpolation averages the noise and lowers its variance further.
#
# **(18.7) Two pairs, one pixel.** Flow can be wrong at a highlight, at an occlusion, or for a fast motion. Then the
# static pair may be better. Assume that the blends $B_{\mathrm m}$ and $B_{\mathrm s}$ of the two pairs have
# independent errors of variance $V_{\mathrm m}$ and $V_{\mathrm s}$. The mix $(1-q)B_{\mathrm m}+qB_{\mathrm s}$ has
# the variance $(1-q)^2V_{\mathrm m}+q^2V_{\mathrm s}$. Its derivative with respect to $q$ is 0 where
# $(1-q)V_{\mathrm m}=qV_{\mathrm s}$, so $q=V_{\mathrm m}/(V_{\mathrm m}+V_{\mathrm s})$.
#
# **(18.8) The variances** are not known. Where a pair is wrong, its two pictures usually disagree. The squared
# differences $e_{\mathrm m}$ and $e_{\mathrm s}$ are therefore used in place of the variances. The window $G_2$
# averages a difference, which reduces its noise. The square of $1/255$, the smallest difference of 8-bit pictures, is
# added, so that two equal pairs have $q=\frac12$ and not $0/0$.
#
# **(18.9) Excluded pixels.** A pixel of an instrument does not show tissue. The interpolation of (18.1) and
# the window of (18.8) also read neighbours of a pixel. In the code, such pixels of both frames have colours of tissue.
# The flow reads the whole pictures. Where only one of $J_0,J_1$ is tissue, this one is the target. Where one of the four
# pictures is excluded, the comparison with the static pair says nothing, and $q=0$.
#
# <!-- definition: endotsr.clips.flow.between.motion_between -->
# ```python
# def motion_between(flows: Flows, fraction: float) -> FloatArray:
#     """The motion field v at the time fraction `fraction` (B14).
#
#     fraction  a in [0, 1]: 0 is the earlier frame, 1 the later
#     returns   (2, H, W) px from the earlier frame to the later, at the position of a point at that time
#
#     Edges:   constant opposite flows give that flow at every time. Swapping the frames and a -> 1 - a only changes the
#              sign of the field.
#     """
#     return motion_field(flows.forward, flows.backward, fraction)
# ```
#
# <!-- definition: endotsr.clips.flow.between.gap_between -->
# ```python
# def gap_between(sequence: Sequence, earlier: int, later: int, flows: Flows) -> Gap:
#     """The gap between two frames; flows from `flows_between` for these frames."""
#     colours = np.stack([tissue_colours(sequence, index) for index in (earlier, later)])
#     return Gap(earlier, later, flows, colours.astype(np.float32) / np.float32(255))
# ```
#
# <!-- definition: endotsr.clips.flow.between.frame_between -->
# ```python
# def frame_between(sequence: Sequence, gap: Gap, fraction: float) -> Frame:
#     """The picture, tissue mask and prior depth at a time between two frames, as a `Frame` (B14).
#
#     gap       from `gap_between`, once for all times between these frames
#     fraction  a in [0, 1]
#     returns   Frame in float32; mask True where one of the frames is tissue; depth 0 where neither has a prior; time and
#               camera interpolated
#
#     Reverse: none; the result is held fixed during training.
#     """
#     from endotsr.clips.opencv.flow import warp_cubic
#
#     earlier, later, flows, images = gap
#     pair, a = [earlier, later], np.float32(fraction)
#     weights = np.array([1.0 - fraction, fraction], np.float32)
#     field = motion_between(flows, fraction)
#     factors = np.array([-a, 1 - a], np.float32)  # (18.1)
#     tissue = sequence.masks[pair]
#     seen, known, depth = moved_priors(tissue, sequence.depth[pair].astype(np.float32, copy=False), field, factors)
#     both = seen[0] & seen[1] & tissue[0] & tissue[1]
#     moved = np.stack([warp_cubic(image, factor * field) for image, factor in zip(images, factors, strict=True)])
#     image = _mixed(moved, images, seen, both, weights)
#     depth = _blended(depth, known, weights)
#     used = seen & (weights > 0)[:, None, None]
#     mask = used[0] | used[1]
#     time = (1.0 - fraction) * float(sequence.times[earlier]) + fraction * float(sequence.times[later])
#     camera = camera_between(sequence.cameras[earlier], sequence.cameras[later], fraction)
#     return Frame(np.ascontiguousarray(np.clip(image, 0, 1)), mask, depth, time, camera)
# ```
#
# <!-- definition: endotsr.clips.flow.between._mixed -->
# ```python
# def _mixed(moved: FloatArray, still: FloatArray, seen: BoolArray, both: BoolArray, weights: FloatArray) -> FloatArray:
#     """(3, H, W) the warped and the unwarped pair, mixed with weights inverse to the local difference within each.
#
#     moved, still  (2, 3, H, W) warped, unwarped
#     seen          (2, H, W) the warped pictures are tissue
#     both          (H, W) both pairs are tissue in both frames; elsewhere only the warped pictures are used
#     weights       (2,) of the two frames
#     """
#     of_moved, of_still = _difference(moved), _difference(still)
#     fraction = np.where(both, of_moved / (of_moved + of_still), np.float32(0))  # of the unwarped pair: (18.7), (18.9)
#     at_rest = weights[0] * still[0] + weights[1] * still[1]  # a matrix product would start library threads
#     return (1 - fraction) * _blended(moved, seen, weights) + fraction * at_rest  # (18.6)
# ```
#
# <!-- definition: endotsr.clips.flow.between._difference -->
# ```python
# def _difference(pair: FloatArray) -> FloatArray:
#     """(H, W) local mean squared difference of two pictures (2, 3, H, W), at least `ONE_STEP`."""
#     from endotsr.clips.opencv.filters import gaussian_blur
#
#     return gaussian_blur(np.square(pair[0] - pair[1]).mean(axis=0), NEARBY) + np.float32(ONE_STEP)  # (18.8)
# ```

# %% [markdown]
# ## The steps in numbers
#
# For step (18.4) the flow is a stretch $f(x)=sx$. Its exact field is $v=sx/(1+as)$, and its backward flow is
# $g(x)=-sx/(1+s)$. The iteration for $v_0$ has $L=s$. That for $v_1$ has $L=s/(1+s)$, with $1-a$ in place of $a$. Away
# from the border of the picture, the error of their mean after three steps is therefore at most
# $(1-a)(as)^4+a\bigl(\frac{(1-a)s}{1+s}\bigr)^4$ times $|v|$.

# %%
HEIGHT, WIDTH = 8, 200
x = np.broadcast_to(np.arange(WIDTH, dtype=np.float32), (HEIGHT, WIDTH))
for s in (0.1, 0.3, 0.6):
    flows = Flows(np.stack([s * x, 0 * x]), np.stack([-s * x / (1 + s), 0 * x]))
    for a in (0.25, 0.5, 0.75):
        exact = s * x / (1 + a * s)
        error = np.abs(motion_between(flows, a)[0] - exact)[:, :100] / np.maximum(
            exact[:, :100], 1
        )
        bound = (1 - a) * (a * s) ** 4 + a * ((1 - a) * s / (1 + s)) ** 4
        assert error.max() < 1.01 * bound + 1e-5, "rounding to float32"
        if a == 0.5:
            print(f"s = {s}: relative error {error.max():.4f}, bound {bound:.4f}")
for s, a in (
    (1.5, 0.75),
    (1.2, 0.75),
    (0.9, 0.75),
    (-0.9, 0.75),
):  # to 2.5, 2.2, 1.9, 0.1 times
    v, far = [s], s / (1 + a * s)
    for _ in range(8):
        v.append(s * (1 - a * v[-1]))  # at x = 1
    shrinks = abs(v[-1] - far) < abs(v[0] - far)
    assert shrinks == (a * abs(s) < 1), "a stretch to 2.2 times is no obstacle at this a"
for degrees in (30, 60, 90):
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    steepest = np.linalg.norm([[cosine - 1, -sine], [sine, cosine - 1]], 2)
    np.testing.assert_allclose(steepest, 2 * np.sin(np.radians(degrees / 2)), rtol=1e-12)

# %% [markdown]
# The next cell checks step (18.5) by exchanging two frames of the clip and replacing $a$ by $1-a$. It checks step
# (18.6) on a clip without motion. Two frames have noise of variance $\sigma^2$, and the cell measures the variance of
# their blends.

# %%
first, second = (int(k) for k in clip.sequence.train_index[4:6])
there = flows_between(clip.sequence, first, second)
back = Flows(there.backward, there.forward)
np.testing.assert_allclose(motion_between(there, 0.25), -motion_between(back, 0.75), atol=1e-5)
still = simulate(with_effects(SimulatorSettings(width=96, height=76, frames=3), "noise"))
calm = simulate(with_effects(SimulatorSettings(width=96, height=76, frames=3))).sequence
rest = Flows(*np.zeros((2, 2, 76, 96), np.float32))
of_frame = np.var((still.sequence.images[0] - calm.images[0].astype(float)) / 255)
steady = gap_between(still.sequence, 0, 1, rest)
for a in (0.25, 0.5):
    made = frame_between(still.sequence, steady, a).image
    of_blend = np.var(made - calm.images[0] / 255)
    print(f"a = {a}: variance {of_blend / of_frame:.2f} times the variance of a frame")
    np.testing.assert_allclose(of_blend / of_frame, (1 - a) ** 2 + a**2, rtol=0.05)
speckle = np.random.default_rng(18).normal(size=(1, 96, 96)).astype(np.float32)
for shift in (0.25, 0.5):
    between = warp_cubic(speckle, np.full((2, 96, 96), shift, np.float32))[0, 4:-4, 4:-4]
    print(f"noise read {shift} px beside the pixels: variance {between.var():.2f}")
    assert between.var() < 0.8

# %% [markdown]
# For step (18.7), two independent errors are mixed with every $q$. The measured variance of the mix is smallest at the
# $q$ of the equation.

# %%
rng = np.random.default_rng(18)
V_m, V_s = 0.3, 1.2
errors = rng.normal(size=(2, 200_000)) * np.sqrt([[V_m], [V_s]])
tried = np.linspace(0, 1, 101)
variance = [np.var((1 - q) * errors[0] + q * errors[1]) for q in tried]
assert abs(tried[np.argmin(variance)] - V_m / (V_m + V_s)) < 0.02

# %% [markdown]
# For step (18.8), the upper half of a picture moves by $8$ px and the lower half is static, but the flow is $8$ px
# everywhere. The moved pair has the larger weight above, and the static pair below.

# %%
rows, columns = np.mgrid[0:96, 0:128]
pattern = lambda shift: np.stack(
    [
        0.5
        + 0.2 * np.sin((columns - shift) / 5 + k) * np.cos(rows / 7 - k)
        + 0.1 * np.sin((columns - shift + 2 * rows) / 3 + k)
        for k in range(3)
    ]
)
frames = np.stack([pattern(0), np.where(rows < 48, pattern(8), pattern(0))]).astype(np.float32)
wrong = np.stack([np.full((96, 128), 8, np.float32), np.zeros((96, 128), np.float32)])
moved = np.stack([warp_cubic(p, s * wrong) for p, s in zip(frames, (-0.5, 0.5))])
of_moved, of_still = definition._difference(moved), definition._difference(frames)
q = of_moved / (of_moved + of_still)
print(f"q: {q[8:40, 16:-16].mean():.3f} above, {q[56:-8, 16:-16].mean():.3f} below")
assert q[8:40, 16:-16].mean() < 0.02 and q[56:-8, 16:-16].mean() > 0.98

# %% [markdown]
# ## Figure: one time between two frames
#
# The clip has breathing, a beat, a pulled spot, light that changes, highlights and a grasper, here with 16 frames.
# Frame 8 is predicted from the frames 6 and 10; the frames between them are not read. Below each picture is its error,
# from 0 (black) to 0.15 (pale yellow); excluded pixels are white. The last panel shows $q$. Its mean is about one half
# where the motion is below a tenth of a pixel. It is smaller where the static frames differ more.

# %% tags=["hide-input"]
scene = replace(named_scene("pulling"), width=160, height=128, frames=16)
hard = simulate(replace(scene, stereo=replace(scene.stereo, on=False))).sequence
before, shown, after = 6, 8, 10
flows = flows_between(hard, before, after)
field = motion_between(flows, 0.5)
target = frame_between(hard, gap_between(hard, before, after, flows), 0.5)
pair = hard.images[[before, after]].astype(np.float32) / 255
moved = np.stack([warp_cubic(p, s * field) for p, s in zip(pair, (-0.5, 0.5))]).clip(0, 1)
of_moved, of_still = definition._difference(moved), definition._difference(pair)
q = of_moved / (of_moved + of_still)
picture = hard.images[shown] / 255
panels = {
    "both frames as they are": pair.mean(axis=0),
    "both frames moved": moved.mean(axis=0),
    "the target": target.image,
}
tissue = hard.masks[shown] & hard.masks[before] & hard.masks[after]
figure, axes = plt.subplots(2, 4, figsize=(10.9, 4.6), layout="constrained")
found = {}
for column, (name, made) in enumerate(panels.items()):
    found[name] = psnr_tissue(made, picture, tissue)
    axes[0, column].imshow(made.transpose(1, 2, 0))
    axes[0, column].set_title(f"{name}: {found[name]:.1f} dB", fontsize=10)
    error = np.where(tissue, np.abs(made - picture).mean(axis=0), np.nan)
    axes[1, column].imshow(error, vmin=0, vmax=0.15, cmap="magma")
axes[0, 3].imshow(picture.transpose(1, 2, 0))
axes[0, 3].set_title(f"frame {shown}, not read", fontsize=10)
axes[1, 3].imshow(np.where(tissue, q, np.nan), vmin=0, vmax=1, cmap="viridis")
axes[1, 3].set_title("q, the fraction of the pair that stayed", fontsize=10)
for panel in axes.flat:
    panel.set(xticks=[], yticks=[])
plt.show()
print({name: round(value, 2) for name, value in found.items()})
assert found["the target"] > found["both frames as they are"] + 2
apart, steady = np.abs(pair[0] - pair[1]).mean(axis=0), np.hypot(*field) < 0.1
of_q = [q[tissue & part].mean() for part in (steady, apart < 0.02, apart > 0.1)]
print(
    "mean q: {:.2f} at rest, {:.2f} where the frames agree, {:.2f} where they differ".format(
        *of_q
    )
)
assert abs(of_q[0] - 0.5) < 0.05 and of_q[2] < of_q[1] - 0.05

# %% [markdown]
# ## The limit of the targets
#
# A target is a picture. It determines the colour at a time, but not which Gaussian should have this colour. The clip
# above shows the difference: the held-out frames gain, but the Gaussians still do not move.

# %%
for name, run in runs.items():
    motion = trajectory_error(run.model, clip.sequence, clip.true_positions)
    print(f"{name:20s} trajectory error {motion.pixels:.2f} px of {motion.motion_pixels:.2f}")
    assert motion.pixels > 0.9 * motion.motion_pixels

# %% [markdown]
# The Gaussians are nearly at rest in both models, so other changes, such as those of colour, imitate the motion at the
# intermediate times as well. {doc}`19_tracked_motion` treats the motion itself.
#
# On the real clip the target is closer to the held-out frames than either pair alone if four or more frames in a row
# are missing. With every eighth frame held out, the moved pair alone is a little closer. The page of {eq}`eq-b14` has
# the table, and {doc}`/results/README` the effect of the targets on training.
#
# ## The reverse pass
#
# There is none. A target is made from training frames and flow, which do not depend on any parameter of the model, so
# it is held fixed like a frame. The losses of {doc}`11_base_losses` are differentiated with respect to the render at
# the intermediate time. In the presets, time enters the model only through the atoms {eq}`eq-1` and the bases
# {eq}`eq-b1`, which are valid at any time. The pair to check is the loss that uses the target.

# %%
with one_thread():
    report = check_pair(all_pairs()["masked_l1"], pair_stream("masked_l1", 0))
print(table([report]))
assert report.passed

# %% [markdown]
# ## Exercise
#
# 1. The tissue moves by $6$ px between two frames, and the flow is 7. Use (18.1) to find where $J_0$ and $J_1$ are
#    read at $a=\frac12$, and how far apart the two pictures of the point are. Is their blend sharper or softer than a
#    frame?
# 2. Write `motion_between` from (18.2) to (18.5) and let the cells of this chapter judge it: assign your function to
#    the name `motion_between` and run the cells below *The steps in numbers* again. No golden case contains a flow,
#    because a port may use any. The loss that uses the target has cases: `--only masked_l1` ({doc}`index`).
# 3. The cell below answers this one. Omit the constant $255^{-2}$ of (18.8). What is $q$ for two equal frames and a
#    flow of 0? Which pixels of a real clip would this affect?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. 0 / 0: both pairs agree exactly. A saturated highlight and a black border are the same
# in both frames, so real clips have such pixels. With the constant q is 1/2, and both
# blends are the same picture anyway.
same = np.full((2, 3, 8, 8), 0.5, np.float32)
of_moved = of_still = definition._difference(same) - np.float32(definition.ONE_STEP)
with np.errstate(invalid="ignore"):
    assert np.isnan(of_moved / (of_moved + of_still)).all()
of_moved = of_still = definition._difference(same)
np.testing.assert_allclose(of_moved / (of_moved + of_still), 0.5)
