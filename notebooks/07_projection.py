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
# # 7. Perspective projection of a Gaussian
#
# An affine map sends a Gaussian to a Gaussian, and perspective is not affine. The centre is therefore projected
# exactly, and the covariance by the first-order expansion of the projection at the centre (EWA splatting, from
# *elliptical weighted average*; {doc}`/references`). The result is an ellipse on the screen.
#
# The input of this stage is a Gaussian with the centre $\mu$, the rotation $R$ and the semi-axes $S$ of
# {doc}`06_covariance`, and a camera. The output is the centre $(u,v)$ of the ellipse in pixels, its covariance with
# the entries $a,b,c$, and the depth $z$. {doc}`09_compositing` turns them into colours of pixels.
#
# The equation is {eq}`eq-b3` of {doc}`/specification/b03_projection`. The optional correction of the camera pose,
# {eq}`eq-b16` of {doc}`/specification/b16_pose`, comes before it.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import pose as pose_definition
from endotsr.definition import projection as definition
from endotsr.definition import settings as definition_settings
from endotsr.method.equations.pose import pose_forward, pose_reverse
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.covariance import Shape, covariance_forward
from endotsr.method.splatting.projection import (
    projection_forward,
    projection_reverse,
    projection_reverse_footprint,
)
from endotsr.method.splatting.settings import EXACT, PAPER
from endotsr.port.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table

# %%
rng = np.random.default_rng(6)
N = 8
turn, _ = covariance_forward(np.array([[1.0], [0.1], [-0.08], [0.05]]), np.zeros((3, 1)))
camera = Camera(
    turn.rotation[:, :, 0].copy(), np.array([0.1, -0.2, 0.3]), 60.0, 66.0, 33.0, 23.5, 64, 48
)
z = rng.uniform(3, 6, N)
off_axis = np.array(
    [[0.1, -0.2, 0.3, 0.9, -0.9, 0.1, 0.9, 0.0], [0.0, 0.1, -0.2, 0.1, 0.1, 0.8, -0.8, 0.0]]
)
mu = camera.rotation.T @ (np.vstack([off_axis * z, z]) - camera.translation[:, None])
shape, _ = covariance_forward(rng.normal(size=(4, N)), rng.normal(-1, 0.5, (3, N)))

# %% [markdown]
# ## The equation
#
# $$
# \begin{aligned}
# (x,y,z)^\top &= W\mu+\mathbf d,\qquad u=f_x\frac xz+c_x,\qquad v=f_y\frac yz+c_y,\\
# x' &= z\,\mathrm{clip}\!\left(\frac xz,-L_x,L_x\right),\qquad L_x=\kappa\frac{W_{px}}{2f_x},\\
# y' &= z\,\mathrm{clip}\!\left(\frac yz,-L_y,L_y\right),\qquad L_y=\kappa\frac{H_{px}}{2f_y},\\
# J&=\begin{bmatrix} f_x/z & 0 & -f_xx'/z^2\\ 0 & f_y/z & -f_yy'/z^2\end{bmatrix},\qquad T=JWR,\\
# \begin{bmatrix}a&b\\b&c\end{bmatrix} &= T\,\mathrm{diag}(S)^2\,T^\top+\varepsilon\,I_2 .
# \end{aligned}
# $$
#
# The symbols, in the order of the lines:
#
# - The rotation $W$ and the translation $\mathbf d$ take a point from the world to the camera, which looks along its $z$
#   axis. The focal lengths in pixels are $f_x,f_y$, the principal point is $(c_x,c_y)$, and the image is $W_{px}$ wide
#   and $H_{px}$ high.
# - $J$ is the derivative of $(u,v)$ with respect to $(x,y,z)$: how far the pixel moves when the point moves a little. It
#   contains the slopes $x/z$ and $y/z$. In $x',y'$ the slopes are clamped to $\pm L_x$ and $\pm L_y$.
# - A small displacement of the world moves the pixel by $JW$ times that displacement, and the covariance of the Gaussian
#   is $R\,\mathrm{diag}(S)^2R^\top$. The covariance on the screen is therefore $JW\,R\,\mathrm{diag}(S)^2R^\top\,(JW)^\top$,
#   the last line with $T=JWR$.
#
# A Gaussian is drawn if its centre is in front of the *near plane*, which means $z>0.2$ scene units (`raster.near`), and
# all numbers above are finite. Any other Gaussian contributes nothing, and its gradients are 0.
#
# Far off the axis the linear expansion grows without bound. The slope that enters $J$ is clamped for this reason, with
# $\kappa=1.3$ in the presets `paper` and `legacy`: if the principal point is the centre of the image, the clamp begins
# $(\kappa-1)/2$ of the width beyond its border. In `exact` there is no clamp. The centre is never clamped. The low-pass
# $\varepsilon$ of 0.3 px² is added to the variance in both directions. The ellipse on the screen, the splat, thus has
# a standard deviation of at least $\sqrt{0.3}\approx0.55$ px in any direction.
#
# <!-- definition: endotsr.definition.projection.jacobian -->
# ```python
# def jacobian(point, camera, settings):
#     """J (2, 3, N) at points (3, N) in camera axes, its slopes x'/z, y'/z (2, N), and which slopes are unclamped."""
#     x, y, z = point
#     fx, fy = camera.fx, camera.fy
#     # Ruling "off-axis clamp of J": slopes up to kappa tan(fov / 2), symmetric; kappa = 0 means no clamp.
#     kappa = settings.jacobian_clamp
#     sizes = np.array([[camera.width / fx], [camera.height / fy]])
#     limit = kappa * sizes / 2 if kappa > 0 else np.inf * sizes
#     slope = np.array([x / z, y / z])
#     free = np.abs(np.real(slope)) <= limit
#     slope = np.where(free, slope, np.copysign(limit, np.real(slope)))
#     j = np.array([[fx / z, 0 * z, -fx * slope[0] / z], [0 * z, fy / z, -fy * slope[1] / z]])
#     return j, slope, free
# ```
#
# <!-- definition: endotsr.definition.projection.projection_forward -->
# ```python
# def projection_forward(position, shape, camera, settings):
#     """Equation (B3): Projected of centres (3, N); cov = J W Sigma W^T J^T + low-pass, det = a c - b^2.
#
#     a c - b^2 loses digits for a needle, which the kernel avoids by a sum of nonnegative terms. The kernel clips axes
#     above 1e60 px (1e8 px in float32) and draws no Gaussian with |u| or |v| above it; here this limit is infinite.
#     """
#     point = camera.rotation @ position + camera.translation[:, None]
#     visible = point[2].real > settings.near  # ruling "near plane"
#     x, y, z = point = np.where(visible, point, 1)
#     t = np.einsum("ijn,jk->ikn", jacobian(point, camera, settings)[0], camera.rotation)
#     cov = np.einsum("ikn,kln,jln->ijn", t, covariance_matrix(shape), t)
#     a, b, c = cov[0, 0] + settings.low_pass, cov[0, 1], cov[1, 1] + settings.low_pass
#     values = np.array([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy, a, b, c, a * c - b * b, z])
#     visible = visible & np.isfinite(values).all(axis=0)
#     values = np.where(visible, values, 0)
#     saved = ProjectionSaved(position, shape, camera, settings, visible)
#     return Projected(values[:2], values[2:5], values[5], values[6], visible), saved
# ```

# %%
presets = (PAPER, definition_settings.PAPER), (EXACT, definition_settings.EXACT)
for settings, text_settings in presets:
    projected, saved = projection_forward(mu, shape, camera, settings)
    text, _ = definition.projection_forward(mu, shape, camera, text_settings)
    for found, expected in zip(projected, text):
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
    in_camera = camera.rotation @ mu + camera.translation[:, None]
    free = definition.jacobian(in_camera, camera, text_settings)[2]
    print(f"{np.count_nonzero(~free.all(axis=0))} of {N} Gaussians beyond the clamp")

# %% [markdown]
# ## The determinant
#
# The renderer needs the inverse of the screen covariance, and for it the determinant $ac-b^2$. For a needle, a
# Gaussian with one long and two short semi-axes, seen at an angle, this is a difference of two large numbers. In
# float32 no correct digit may remain. The specification writes the determinant as a sum of terms that cannot cancel:
#
# $$
# \det=\varepsilon^2+\varepsilon\sum_{k=1}^{3}S_k^2\|\mathbf t_k\|^2+\sum_{k<l}\bigl(S_kS_l\,(t_{0k}t_{1l}-t_{1k}t_{0l})\bigr)^2 .
# $$
#
# Here $\mathbf t_k$ are the columns of $T$ and $t_{0k},t_{1k}$ their entries. The sum is the determinant of
# $MM^\top+\varepsilon I$ with $M=T\,\mathrm{diag}(S)$: by the formula of Cauchy and Binet, $\det MM^\top$ is the sum
# of the squares of the $2\times2$ minors of $M$. The definition uses $ac-b^2$, and in float64 both agree. The compiled
# function uses the sum.


# %%
def screen_matrix(i):
    """T = J W R of Gaussian i, with the clamp of `paper`."""
    J = definition.jacobian(in_camera[:, i : i + 1], camera, definition_settings.PAPER)[0]
    return J[:, :, 0] @ camera.rotation @ shape.rotation[:, :, i], J[:, :, 0]


def determinant_of(T, S, eps=0.3):
    minors = [
        S[k] * S[m] * (T[0, k] * T[1, m] - T[1, k] * T[0, m])
        for k in range(3)
        for m in range(k + 1, 3)
    ]
    return eps**2 + eps * (S**2 * (T**2).sum(axis=0)).sum() + np.sum(np.square(minors))


projected, _ = projection_forward(mu, shape, camera, PAPER)
sums = [determinant_of(screen_matrix(i)[0], shape.scale[:, i]) for i in range(N)]
np.testing.assert_allclose(projected.determinant, sums, rtol=1e-11)

# %% [markdown]
# ## Figure: where the expansion is accurate, and where digits are lost
#
# In the first two panels grey points are drawn from a Gaussian and projected exactly. An ellipse of two standard deviations
# should contain the fraction $1-e^{-2}=0.86$ of them. The second Gaussian is nearer and reaches deeper along the view. Does
# its ellipse contain more of the points or fewer? The right panel has the relative error of the determinant in float32, for
# both ways to compute it.

# %% tags=["hide-input"]
front = Camera(np.eye(3), np.zeros(3), 60.0, 60.0, 32.0, 24.0, 64, 48)
figure, axes = plt.subplots(1, 3, figsize=(10.1, 3.4), layout="constrained")
circle = 2 * np.stack(
    [np.cos(np.linspace(0, 2 * np.pi, 200)), np.sin(np.linspace(0, 2 * np.pi, 200))]
)
scenes = (
    ("small and far: the ellipse fits", [0.8, -0.3, 5.0], [0.35, 0.15, 0.3]),
    ("deep and near: it cannot", [0.5, -0.2, 2.0], [0.25, 0.1, 0.55]),
)
for panel, (title, centre, axes_length) in zip(axes, scenes):
    tilt, _ = covariance_forward(
        np.array([[0.9], [0.2], [0.3], [0.1]]), np.log(axes_length)[:, None]
    )
    flat, _ = projection_forward(np.array(centre)[:, None], tilt, front, EXACT)
    cloud = np.array(centre)[:, None] + tilt.rotation[:, :, 0] @ (
        tilt.scale[:, :1] * rng.normal(size=(3, 3000))
    )
    cloud = cloud[:, cloud[2] > 0.3]
    panel.plot(
        60 * cloud[0] / cloud[2] + 32,
        60 * cloud[1] / cloud[2] + 24,
        ".",
        ms=1.5,
        color="0.6",
        label="exact projection of its points",
    )
    a, b, c = flat.covariance2d[:, 0]
    outline = np.linalg.cholesky([[a, b], [b, c]]) @ circle + flat.mean2d
    apart = (
        np.array([60 * cloud[0] / cloud[2] + 32, 60 * cloud[1] / cloud[2] + 24]) - flat.mean2d
    )
    whitened = np.linalg.solve(np.linalg.cholesky([[a, b], [b, c]]), apart)
    inside = np.mean((whitened**2).sum(axis=0) < 4)
    print(f"{title}: {inside:.2f} of the points inside")
    small = title.startswith("small")
    assert abs(inside - 0.86) < 0.02 if small else round(inside, 2) == 0.83
    panel.plot(*outline, color="tab:blue", label="EWA, two standard deviations")
    panel.plot(*flat.mean2d, "r+", ms=10)
    panel.set(title=title, xlim=(0, 64), ylim=(48, 0), aspect="equal", xlabel="$u$, px")
axes[0].set_ylabel("$v$, px")
axes[0].legend(loc="lower left")

lengths = np.geomspace(1, 3e4, 60)
errors = {"$ac-b^2$": [], "sum of terms": []}
for pixels in lengths:
    needle = Shape(
        *(
            part.astype(np.float32)
            for part in covariance_forward(
                np.array([[0.92], [0.0], [0.0], [0.38]]),
                np.log([[pixels / 60], [1e-3], [1e-3]]),
            )[0]
        )
    )
    at = np.array([[0.0], [0.0], [1.0]], np.float32)
    single, _ = projection_forward(at, needle, front, EXACT)
    double, _ = projection_forward(
        at.astype(float),
        Shape(needle.rotation.astype(float), needle.scale.astype(float)),
        front,
        EXACT,
    )
    a, b, c = single.covariance2d[:, 0]
    errors["$ac-b^2$"].append(abs(float(a * c - b * b) / double.determinant[0] - 1))
    errors["sum of terms"].append(abs(float(single.determinant[0]) / double.determinant[0] - 1))
assert max(errors["sum of terms"]) < 3e-6 and max(errors["$ac-b^2$"]) > 0.5
for name, colour in zip(errors, ("tab:red", "tab:green")):
    axes[2].loglog(lengths, np.maximum(errors[name], 1e-8), ".-", color=colour, label=name)
axes[2].set(title="relative error of det, float32", xlabel="length of a needle [px]")
axes[2].legend()
plt.show()

# %% [markdown]
# Fewer: 0.83 instead of 0.86. The expansion lacks the curvature of the projection over the depth of the second Gaussian.

# %% [markdown]
# ## The reverse pass, line by line
#
# The stages after this one give the gradients $g_u,g_v$ of the centre, $g_a,g_b,g_c$ of the screen covariance, and
# $g_z^{\mathrm{img}}$, the gradient with respect to $z$ that comes from the depth image. We differentiate from the
# last line of the equation upward.
#
# **(7.1) The three numbers as a matrix.** A matrix of gradients $G_2$ must give the same change of the loss as the three
# numbers, $g_a\,\mathrm da+g_b\,\mathrm db+g_c\,\mathrm dc=\langle G_2,\mathrm d\Sigma_2\rangle$. The number $b$ stands in two entries
# of the symmetric matrix $\Sigma_2$, so each of the two takes half of its gradient:
# $G_2=\begin{bmatrix}g_a&g_b/2\\g_b/2&g_c\end{bmatrix}$.
#
# **(7.2) The product.** The screen covariance is $MM^\top+\varepsilon I$ with $M=T\,\mathrm{diag}(S)$. As in (6.1), and
# because $G_2$ is symmetric, $g_M=2\,G_2M$. The low-pass is a constant and drops out.
#
# **(7.3) Its factors.** The product $M_{jk}=T_{jk}S_k$ gives $g_{S_k}=\sum_jT_{jk}\,g_{M_{jk}}$ and $g_T=g_M\,\mathrm{diag}(S)$, as in
# (6.2). The definition has $JW$ in `t`, goes through $\Sigma$ and reaches the same $g_S$ and $g_R$.
#
# **(7.4) The three matrices.** The product $T=JWR$ gives $\mathrm dT=\mathrm dJ\,WR+J\,\mathrm dW\,R+JW\,\mathrm dR$. A factor to the
# left of the differential moves to the left of $g_T$, transposed; a factor to the right moves to the right:
# $g_J=g_T(WR)^\top$, $g_R=(JW)^\top g_T$, and $g_W$ receives $J^\top g_TR^\top$.
#
# $$
# \begin{aligned}
# g_M&=2\,G_2\,M,\qquad g_{S_k}=\sum_j T_{jk}\,g_{M_{jk}},\qquad g_T=g_M\,\mathrm{diag}(S),\\
# g_J&=g_T\,(WR)^\top,\qquad g_R=(JW)^\top g_T .
# \end{aligned}
# $$
#
# **(7.5) The footprint.** The gradients $g_a,g_b,g_c$ of a needle are large and nearly cancel. The renderer of {doc}`09_compositing`
# does not use $a,b,c$ but three other numbers, the footprint $(A,m,r)=(c/\det,\ b/c,\ 1/c)$, and returns their
# gradients $g_A,g_m,g_r$. From them one can go directly to $S$ and $T$, without $g_a,g_b,g_c$ as numbers. This takes
# four steps. (A first reading can skip them: (7.2) and (7.3) give the same gradients in float64.)
#
# *The entries.* With the rows $\mathbf t_0,\mathbf t_1$ of $T$: $a=\sum_kS_k^2t_{0k}^2+\varepsilon$,
# $b=\sum_kS_k^2t_{0k}t_{1k}$ and $c=\sum_kS_k^2t_{1k}^2+\varepsilon$. So $\partial(a,b,c)/\partial
# S_k=2S_k\,(t_{0k}^2,\ t_{0k}t_{1k},\ t_{1k}^2)$, $\partial(a,b)/\partial t_{0k}=S_k^2\,(2t_{0k},\ t_{1k})$ and
# $\partial(b,c)/\partial t_{1k}=S_k^2\,(t_{0k},\ 2t_{1k})$.
#
# *The semi-axes.* The chain rule from $(A,m,r)$ to $(a,b,c)$, step (9.8) of {doc}`09_compositing`, is $g_a=-A^2g_A$,
# $g_b=2A^2m\,g_A+r\,g_m$ and $g_c=-A^2m^2g_A-m\,r\,g_m-r^2g_r$. Insert it into
# $g_{S_k}=2S_k\,(g_at_{0k}^2+g_bt_{0k}t_{1k}+g_ct_{1k}^2)$ and collect. The terms with $g_A$ are
# $-A^2(t_{0k}^2-2m\,t_{0k}t_{1k}+m^2t_{1k}^2)=-A^2e_k^2$ with $e_k=t_{0k}-m\,t_{1k}$. Those with $g_m$ are
# $r\,(t_{0k}t_{1k}-m\,t_{1k}^2)=r\,t_{1k}e_k$, and the one with $g_r$ is $-r^2t_{1k}^2$. The square of a small $e_k$
# has taken the place of three large terms.
#
# *The entries of $T$.* $g_{T_{0k}}=S_k^2\,(2g_at_{0k}+g_bt_{1k})$ and $g_{T_{1k}}=S_k^2\,(g_bt_{0k}+2g_ct_{1k})$.
# Inserting as before, $2g_at_{0k}+g_bt_{1k}=-2A^2g_A\,e_k+r\,g_m\,t_{1k}$, and
# $g_bt_{0k}+2g_ct_{1k}=2A^2m\,g_A\,e_k+r\,g_m\,(t_{0k}-2m\,t_{1k})-2r^2g_r\,t_{1k}$, where
# $t_{0k}-2m\,t_{1k}=e_k-m\,t_{1k}$.
#
# *$e_k$ itself.* The expression $t_{0k}-m\,t_{1k}$ is a difference too. With $m=b/c$ it is $r\,(c\,t_{0k}-b\,t_{1k})$. Insert $b$ and
# $c$ as sums over $l$: the low-pass contributes $\varepsilon t_{0k}$, and each $l$ contributes
# $S_l^2\,(t_{1l}^2t_{0k}-t_{0l}t_{1l}t_{1k})=S_l^2\,t_{1l}\,(t_{0k}t_{1l}-t_{1k}t_{0l})$. The term $l=k$ is exactly 0.
# The brackets are the minors of the determinant above.
#
# $$
# \begin{aligned}
# e_k&=r\Bigl[\varepsilon\,t_{0k}+\sum_l S_l^2\,t_{1l}\,(t_{0k}t_{1l}-t_{1k}t_{0l})\Bigr],\\
# g_{S_k}&=-2S_k\bigl[A^2g_A\,e_k^2-r\,g_m\,t_{1k}e_k+r^2g_r\,t_{1k}^2\bigr],\\
# g_{T_{0k}}&=S_k^2\bigl[r\,g_m\,t_{1k}-2A^2g_A\,e_k\bigr],\\
# g_{T_{1k}}&=S_k^2\bigl[2A^2m\,g_A\,e_k+r\,g_m\,(e_k-m\,t_{1k})-2r^2g_r\,t_{1k}\bigr].
# \end{aligned}
# $$
#
# The centre comes next. It enters through $(u,v)$ and through $J$.
#
# **(7.6) The last column of $J$.** $J_{02}=-f_xx'/z^2$, so $g_{x'}=-f_x/z^2\,g_{J_{02}}$, and in the same way for $y'$.
#
# **(7.7) The clamp.** $x'=z\,\mathrm{clip}(x/z)$. Where the clip is not active, $x'=x$ and $g_{x'}$ goes to $x$. Where
# it is active, $x'=\pm zL_x$ does not depend on $x$ but does depend on $z$: $\partial x'/\partial z=\pm L_x=x'/z$.
#
# **(7.8) Screen position.** The pixel $u=f_xx/z+c_x$ gives $\mathrm du=\frac{f_x}z\mathrm dx-\frac{f_xx}{z^2}\mathrm dz$, and in the
# same way for $v$.
#
# **(7.9) The depth in $J$.** With $x'$ held fixed, $\partial J_{00}/\partial z=-f_x/z^2$ and
# $\partial J_{02}/\partial z=2f_xx'/z^3$. The definition takes the slope $x'/z$ as the variable instead:
# $J_{02}=-f_x(x'/z)/z$ then has a single $1/z$. A free slope also depends on $z$, by $\partial(x/z)/\partial z=-x/z^2$; a
# clamped one does not.
#
# **(7.10) Into the world.** The point $(x,y,z)^\top=W\mu+\mathbf d$ gives $g_\mu=W^\top(g_x,g_y,g_z)^\top$.
#
# $$
# \begin{aligned}
# g_x &= \frac{f_x}{z}g_u+[\,|x/z|\le L_x\,]\,g_{x'},\qquad g_y=\frac{f_y}{z}g_v+[\,|y/z|\le L_y\,]\,g_{y'},\\
# g_z &= g_z^{\mathrm{img}}-\frac{f_xx\,g_u+f_yy\,g_v}{z^2}-\frac{f_x}{z^2}g_{J_{00}}-\frac{f_y}{z^2}g_{J_{11}}
# +\frac{2f_xx'}{z^3}g_{J_{02}}+\frac{2f_yy'}{z^3}g_{J_{12}}\\
# &\quad+[\,|x/z|>L_x\,]\,\frac{x'}{z}\,g_{x'}+[\,|y/z|>L_y\,]\,\frac{y'}{z}\,g_{y'},\\
# g_\mu&=W^\top(g_x,g_y,g_z)^\top .
# \end{aligned}
# $$
#
# **(7.11) The pose.** The same point also gives the gradient with respect to $\mathbf d$, and the
# second part of the one with respect to $W$; the first part is that of (7.4). Both are sums over all Gaussians.
# The centre of the camera is $\mathbf o=-W^\top\mathbf d$. Its gradient $g_{\mathbf o}$ comes from the viewing
# directions of {doc}`08_harmonics`, and the reverse pass of the render adds the terms that contain it.
#
# $$
# \begin{aligned}
# g_{\mathbf d}&=\sum_i (g_x,g_y,g_z)_i^\top-W g_{\mathbf o},\\
# g_W&=\sum_i\bigl[(g_x,g_y,g_z)_i^\top\mu_i^\top+J_i^\top g_{T,i}R_i^\top\bigr]-\mathbf d\,g_{\mathbf o}^\top,
# \end{aligned}
# $$
#
# where $i$ runs over the Gaussians.
#
# <!-- definition: endotsr.definition.projection.projection_reverse -->
# ```python
# def projection_reverse(d_mean2d, d_covariance2d, d_depth, saved):
#     """Reverse of (B3): b represents two entries. For needles, the kernel of the render starts from A, m, r."""
#     position, shape, camera, settings, visible = saved
#     d_mean2d, d_covariance2d, d_depth = (np.where(visible, g, 0) for g in (d_mean2d, d_covariance2d, d_depth))
#     w = camera.rotation
#     point = np.where(visible, w @ position + camera.translation[:, None], 1)
#     j, slope, free = jacobian(point, camera, settings)
#     g_sigma, g_t = covariance_reverse_parts(d_covariance2d, saved, point)
#     g_m = 2 * np.einsum("ijn,jkn->ikn", g_sigma, shape.rotation * shape.scale)  # (6.1)
#     d_scale = (shape.rotation * g_m).sum(axis=0)  # (6.2), (7.3)
#     g_j = np.einsum("ikn,jk->ijn", g_t, w)
#     g_point = point_reverse(point, slope, free, g_j, d_mean2d, d_depth, camera)
#     d_w = g_point @ np.where(visible, position, 0).T + np.einsum("ijn,ikn->jk", j, g_t)  # (7.4), (7.11)
#     return ProjectionGrads(w.T @ g_point, g_m * shape.scale, d_scale, CameraGrads(d_w, g_point.sum(axis=1)))  # (7.10)
# ```
#
# <!-- definition: endotsr.definition.projection.point_reverse -->
# ```python
# def point_reverse(point, slope, free, g_j, d_mean2d, d_depth, camera):
#     """dL/d(point in camera axes) (3, N), from the derivatives with respect to J, (u, v) and depth."""
#     z = point[2]
#     focal = np.array([[camera.fx], [camera.fy]])
#     by_slope = np.array([g_j[0, 2], g_j[1, 2]])
#     g_slope = -focal / z * by_slope  # J_02 = -f (x'/z) / z; (7.6)
#     g_clipped = np.where(free, g_slope, 0)  # ruling: exact derivative of the clamp; (7.7)
#     g_xy = (focal * d_mean2d + g_clipped) / z  # (7.8)
#     by_scale = -focal / z**2 * (np.array([g_j[0, 0], g_j[1, 1]]) - slope * by_slope)  # (7.9)
#     g_z = d_depth + (by_scale - g_xy * point[:2] / z).sum(axis=0)
#     return np.concatenate([g_xy, [g_z]])
# ```

# %%
g_uv, g_abc, g_z = rng.normal(size=(2, N)), rng.normal(size=(3, N)), rng.normal(size=N)
for settings, text_settings in presets:
    _, saved = projection_forward(mu, shape, camera, settings)
    grads = projection_reverse(g_uv, g_abc, g_z, saved, pose_gradient=True)
    _, text_saved = definition.projection_forward(mu, shape, camera, text_settings)
    text = definition.projection_reverse(g_uv, g_abc, g_z, text_saved)
    for found, expected in zip((*grads[:3], *grads.d_camera), (*text[:3], *text.d_camera)):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
g_d, g_W = text.d_camera.d_translation, text.d_camera.d_rotation

# %% [markdown]
# The definition does not contain the direct form (7.5); only the compiled function needs it, in float32. It gives the
# same gradients as the form through $(a,b,c)$:


# %%
def footprint_reverse_text(g_A, g_m, g_r, T, S, a, b, c, det, eps=0.3):
    """g_S and g_T of one Gaussian from the footprint."""
    A, m, r = c / det, b / c, 1 / c
    g_S, g_T = np.zeros(3), np.zeros((2, 3))
    for k in range(3):
        e_k = r * (
            eps * T[0, k]
            + sum(
                S[l] ** 2 * T[1, l] * (T[0, k] * T[1, l] - T[1, k] * T[0, l]) for l in range(3)
            )
        )
        g_S[k] = (
            -2
            * S[k]
            * (A**2 * g_A * e_k**2 - r * g_m * T[1, k] * e_k + r**2 * g_r * T[1, k] ** 2)
        )
        g_T[0, k] = S[k] ** 2 * (r * g_m * T[1, k] - 2 * A**2 * g_A * e_k)
        g_T[1, k] = S[k] ** 2 * (
            2 * A**2 * m * g_A * e_k + r * g_m * (e_k - m * T[1, k]) - 2 * r**2 * g_r * T[1, k]
        )
    return g_S, g_T


# %%
g_A, g_m, g_r = g_abc  # any numbers will do
projected, saved = projection_forward(mu, shape, camera, PAPER)
direct = projection_reverse_footprint(g_uv, g_abc, g_z, saved)
a, b, c = projected.covariance2d
A, m, r = c / projected.determinant, b / c, 1 / c
g_through = np.stack(
    [
        -(A**2) * g_A,
        2 * A**2 * m * g_A + r * g_m,
        -(A**2) * m**2 * g_A - m * r * g_m - r**2 * g_r,
    ]
)
through = projection_reverse(g_uv, g_through, g_z, saved)
for i in range(N):
    S, (T, J) = shape.scale[:, i], screen_matrix(i)
    g_S, g_T = footprint_reverse_text(
        g_A[i], g_m[i], g_r[i], T, S, a[i], b[i], c[i], projected.determinant[i]
    )
    np.testing.assert_allclose(direct.d_scale[:, i], g_S, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(
        direct.d_rotation[:, :, i], (J @ camera.rotation).T @ g_T, rtol=1e-9, atol=1e-12
    )
for name in ("position", "rotation", "scale"):
    np.testing.assert_allclose(
        getattr(direct, f"d_{name}"), getattr(through, f"d_{name}"), rtol=1e-7, atol=1e-9
    )

# %% [markdown]
# ## The correction of the pose
#
# $$
# \begin{aligned}
# E&=I+\alpha\,[\boldsymbol\omega]_\times+\beta\,[\boldsymbol\omega]_\times^2,\qquad
# \alpha=\frac{\sin\vartheta}{\vartheta},\quad\beta=\frac{1-\cos\vartheta}{\vartheta^2},\\
# W'&=E\,W,\qquad\mathbf d'=E\,\mathbf d+\boldsymbol\tau .
# \end{aligned}
# $$
#
# A pose that was measured or estimated has small errors, and training can correct them. The correction of one view has
# six numbers: a rotation vector $\boldsymbol\omega$, whose direction is the axis and whose length $\vartheta$ is the angle,
# and an offset $\boldsymbol\tau$. The matrix $[\boldsymbol\omega]_\times$ is the one with $[\boldsymbol\omega]_\times\mathbf
# p=\boldsymbol\omega\times\mathbf p$, and $E$ is its exponential, a rotation. The view is rendered with $W'$ and
# $\mathbf d'$, and the projection above returns the gradients with respect to them.
#
# **(7.12) The two products.** The products $W'=EW$ and $\mathbf d'=E\mathbf d+\boldsymbol\tau$ give $g_W=E^\top g_{W'}$,
# $g_{\mathbf d}=E^\top g_{\mathbf d'}$, $g_{\boldsymbol\tau}=g_{\mathbf d'}$ and
# $G=g_E=g_{W'}W^\top+g_{\mathbf d'}\mathbf d^\top$.
#
# **(7.13) The closed form.** Let $K=[\boldsymbol\omega]_\times$, so $E=I+\alpha K+\beta K^2$. Every entry of $E$
# depends on $\omega_i$ in two ways. The first is $K$ itself, with $\partial K/\partial\omega_i=[\mathbf e_i]_\times$.
# The second is $\vartheta$ in the two factors: $\partial\vartheta/\partial\omega_i=\omega_i/\vartheta$, and their derivatives with respect to
# $\omega_i$ are $\omega_i\alpha'$ and $\omega_i\beta'$ with $\alpha'=(\cos\vartheta-\alpha)/\vartheta^2$ and
# $\beta'=(\alpha-2\beta)/\vartheta^2$. The compiled function sums these parts:
# $g_{\omega_i}=\langle\alpha G+\beta(GK^\top+K^\top G),[\mathbf e_i]_\times\rangle+\omega_i\langle G,\alpha'K+\beta'K^2\rangle$.
#
# **(7.14) The definition** needs no derivative of a series. The exponential of the block matrix
# $\begin{bmatrix}K^\top&G\\0&K^\top\end{bmatrix}$ has $E^\top$ in its diagonal blocks and $g_K$ in the upper right one.
# The spin of (6.5) turns $g_K$ into $g_{\boldsymbol\omega}$.
#
# <!-- definition: endotsr.definition.pose.exponential -->
# ```python
# def exponential(matrix):
#     """Taylor series of exp(matrix / 2^s), squared s times. The kernel has the closed form for 3 x 3."""
#     halvings = max(0, int(np.ceil(np.log2(np.abs(matrix).sum() + 1))))
#     term = total = np.eye(len(matrix))
#     for k in range(1, 20):
#         term = term @ matrix / 2**halvings / k
#         total = total + term
#     return np.linalg.matrix_power(total, 2**halvings)
# ```
#
# <!-- definition: endotsr.definition.pose.pose_forward -->
# ```python
# def pose_forward(rotation, translation, rotation_vector, offset):
#     """Equation (B16): W' = E W (3, 3) and d' = E d + tau (3,), E = exp([omega]_x), omega in rad, tau in scene units."""
#     e = exponential(CROSS @ rotation_vector)
#     return e @ rotation, e @ translation + offset, PoseSaved(rotation, translation, rotation_vector)
# ```
#
# <!-- definition: endotsr.definition.pose.pose_reverse -->
# ```python
# def pose_reverse(d_rotation, d_translation, saved):
#     """Reverse of (B16): the derivative of exp is the upper right block of exp [[K, G], [0, K]], K = [omega]_x^T."""
#     rotation, translation, vector = saved
#     k = (CROSS @ vector).T
#     g = d_rotation @ rotation.T + np.outer(d_translation, translation)  # (7.12)
#     both = exponential(np.block([[k, g], [np.zeros((3, 3)), k]]))  # (7.14)
#     e, d_cross = both[:3, :3].T, both[:3, 3:]
#     return PoseGrads(e.T @ d_rotation, e.T @ d_translation, np.einsum("ij,ijk->k", d_cross, CROSS), d_translation)
# ```

# %%
W, d, omega, tau = (
    camera.rotation,
    camera.translation,
    np.array([0.3, -0.2, 0.5]),
    np.array([0.1, 0.0, -0.2]),
)
*corrected, saved_pose = pose_forward(W, d, omega, tau)
*expected, text_saved = pose_definition.pose_forward(W, d, omega, tau)
for array, text in zip(corrected, expected):
    np.testing.assert_allclose(array, text, rtol=1e-13)
for array, text in zip(
    pose_reverse(g_W, g_d, saved_pose), pose_definition.pose_reverse(g_W, g_d, text_saved)
):
    np.testing.assert_allclose(array, text, rtol=1e-11)

# (7.13), written out
K, angle = pose_definition.CROSS @ omega, np.linalg.norm(omega)
alpha, beta = np.sin(angle) / angle, (1 - np.cos(angle)) / angle**2
G = g_W @ W.T + np.outer(g_d, d)
inner = alpha * G + beta * (G @ K.T + K.T @ G)
factors = (np.cos(angle) - alpha) / angle**2 * K + (alpha - 2 * beta) / angle**2 * K @ K
closed = np.einsum("ij,ijk->k", inner, pose_definition.CROSS) + omega * (G * factors).sum()
np.testing.assert_allclose(pose_reverse(g_W, g_d, saved_pose)[2], closed, rtol=1e-11)

# %% [markdown]
# ## The gradient check
#
# The check runs with the clamp and without it. The inputs include Gaussians beyond the clamp on all four sides and one
# behind the camera. The correction of the pose is checked at a wide and at a small angle.

# %%
with one_thread():
    reports = [
        check_pair(all_pairs()[name], pair_stream(name, 0))
        for name in ("projection_exact", "projection_paper", "pose", "pose_small")
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. A Gaussian is on the optical axis. Which entries of $J$ are 0, and which gradients does $g_z$ then lack in (7.9)?
# 2. Write `pose_reverse` from (7.12) and (7.13) and let the golden cases judge it: `--only pose` ({doc}`index`).
# 3. The cell below answers this one. Make everything twice as large: positions, semi-axes, the
#    translation of the camera, the near plane. What happens to $(u,v)$, to $(a,b,c)$ and to $z$? What happens to the
#    gradient with respect to the position?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The screen does not change: x/z does not, and J halves while S doubles. z doubles.
# The gradient with respect to the position halves (if no loss depends on z), because a step of
# one scene unit is now half as many pixels.
doubled = projection_forward(
    2 * mu,
    shape._replace(scale=2 * shape.scale),
    camera._replace(translation=2 * camera.translation),
    PAPER._replace(near=0.4),
)
single = projection_forward(mu, shape, camera, PAPER)
np.testing.assert_allclose(doubled[0].mean2d, single[0].mean2d, rtol=1e-12)
np.testing.assert_allclose(
    doubled[0].covariance2d, single[0].covariance2d, rtol=1e-9, atol=1e-9
)
np.testing.assert_allclose(doubled[0].depth, 2 * single[0].depth, rtol=1e-13)
back = [
    projection_reverse(g_uv, g_abc, 0 * g_z, saved).d_position
    for saved in (doubled[1], single[1])
]
np.testing.assert_allclose(back[0], back[1] / 2, rtol=1e-9, atol=1e-10)
