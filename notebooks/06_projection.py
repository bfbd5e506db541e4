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
# # 6. Perspective projection of a Gaussian
#
# The centre of a Gaussian is projected exactly. Its covariance is projected by the first-order expansion of the
# projection at the centre (EWA). The result is an ellipse on the screen.
#
# The equation is {eq}`eq-b3` of {doc}`/specification/b03_projection`. The optional correction of the camera pose,
# {eq}`eq-b16` of {doc}`/specification/b16_pose`, comes before it.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}
import matplotlib.pyplot as plt
import numpy as np

from endotsr.equations.pose import pose_forward, pose_reverse
from endotsr.gradcheck import all_pairs, check_pair, one_thread, pair_stream, table
from endotsr.splatting.camera import Camera
from endotsr.splatting.covariance import Shape, covariance_forward
from endotsr.splatting.projection import (
    projection_forward,
    projection_reverse,
    projection_reverse_footprint,
)
from endotsr.splatting.settings import EXACT, PAPER

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
# $W,\mathbf d$ are the camera pose, world to camera. Far off the axis the linear expansion grows without bound, so the
# slope that enters $J$ is clamped, with $\kappa=1.3$ in the presets `paper` and `legacy`. In `exact` there is no clamp.
# The centre is never clamped. $\varepsilon$ is the low-pass of 0.3 px². It prevents a splat from being thinner than a
# pixel.


# %% tags=["transcription"]
def project_text(mu, R, S, camera, kappa, eps=0.3):
    """One Gaussian: (u, v), (a, b, c), z and what the reverse pass uses again."""
    W, d = camera.rotation, camera.translation
    x, y, z = W @ mu + d
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    L_x = kappa * camera.width / (2 * camera.fx) if kappa else np.inf
    L_y = kappa * camera.height / (2 * camera.fy) if kappa else np.inf
    x_, y_ = z * np.clip(x / z, -L_x, L_x), z * np.clip(y / z, -L_y, L_y)
    J = np.array(
        [[camera.fx / z, 0, -camera.fx * x_ / z**2], [0, camera.fy / z, -camera.fy * y_ / z**2]]
    )
    T = J @ W @ R
    (a, b), (_, c) = T @ np.diag(S) ** 2 @ T.T + eps * np.eye(2)
    return (u, v), (a, b, c), z, (x, y, x_, y_, L_x, L_y, J, T)


def determinant_text(T, S, eps=0.3):
    crosses = [
        (S[k] * S[m] * (T[0, k] * T[1, m] - T[1, k] * T[0, m])) ** 2
        for k in range(3)
        for m in range(k + 1, 3)
    ]
    return eps**2 + eps * sum(S[k] ** 2 * (T[:, k] ** 2).sum() for k in range(3)) + sum(crosses)


# %%
for settings in (PAPER, EXACT):
    projected, saved = projection_forward(mu, shape, camera, settings)
    clamped = 0
    for i in range(N):
        R, S = shape.rotation[:, :, i], shape.scale[:, i]
        uv, abc, depth, parts = project_text(mu[:, i], R, S, camera, settings.jacobian_clamp)
        np.testing.assert_allclose(projected.mean2d[:, i], uv, rtol=1e-12)
        np.testing.assert_allclose(projected.covariance2d[:, i], abc, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(projected.depth[i], depth, rtol=1e-13)
        np.testing.assert_allclose(
            projected.determinant[i], determinant_text(parts[-1], S), rtol=1e-11
        )
        clamped += abs(parts[0] / depth) > parts[4] or abs(parts[1] / depth) > parts[5]
    print(f"{clamped} of {N} Gaussians beyond the clamp")

# %% [markdown]
# ## The determinant
#
# For a needle seen at an angle, $ac-b^2$ is a difference of two large numbers. The specification writes the determinant
# as a sum of terms that cannot cancel:
#
# $$
# \det=\varepsilon^2+\varepsilon\sum_{k=1}^{3}S_k^2\|\mathbf t_k\|^2+\sum_{k<l}\bigl(S_kS_l\,(t_{0k}t_{1l}-t_{1k}t_{0l})\bigr)^2 .
# $$
#
# ## Figure: where the expansion is accurate, and where digits are lost

# %% tags=["hide-input"]
front = Camera(np.eye(3), np.zeros(3), 60.0, 60.0, 32.0, 24.0, 64, 48)
figure, axes = plt.subplots(1, 3, figsize=(13, 3.9), layout="constrained")
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
    panel.plot(*outline, color="tab:blue", label="EWA, two standard deviations")
    panel.plot(*flat.mean2d, "r+", ms=10)
    panel.set(title=title, xlim=(0, 64), ylim=(48, 0), aspect="equal")
axes[0].legend(fontsize=8, loc="lower left")

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
# ## The reverse pass
#
# We differentiate from the last line upward. The screen covariance is $MM^\top+\varepsilon I$ with
# $M=T\,\mathrm{diag}(S)$, so this step is the same as for $\Sigma$. $b$ stands for two entries of the matrix, and half
# of its gradient goes to each. This gives $G_2$.
#
# $$
# \begin{aligned}
# g_M&=2\,G_2\,M,\qquad g_{S_k}=\sum_r T_{rk}\,g_{M_{rk}},\qquad g_T=g_M\,\mathrm{diag}(S),\\
# g_J&=g_T\,(WR)^\top,\qquad g_R=(JW)^\top g_T .
# \end{aligned}
# $$
#
# In float32 this form loses digits: $g_a,g_b,g_c$ of a needle are large and nearly cancel. The renderer therefore goes
# from the gradients of the footprint $(A,m,r)=(c/\det,\ b/c,\ 1/c)$ of {doc}`08_compositing` directly to $S$ and $T$.
# This is the same chain rule, with $e_k=t_{0k}-m\,t_{1k}$ written so that nothing cancels:
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
# The centre comes next. It enters through $(u,v)$ and through $J$, whose entries depend on $z$ and on the clamped
# $x',y'$. Where the clamp is not active, $x'=x$. Where it is active, $x'=\pm zL_x$, which does not depend on $x$ but
# does depend on $z$. This gives the last line.
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
# The gradient with respect to the pose is a sum over all Gaussians. (The terms with $g_{\mathbf o}$ come from the
# viewing directions and are not part of this stage.)
#
# $$
# \begin{aligned}
# g_{\mathbf d}&=\sum_i (g_x,g_y,g_z)_i^\top-W g_{\mathbf o},\\
# g_W&=\sum_i\bigl[(g_x,g_y,g_z)_i^\top\mu_i^\top+J_i^\top g_{T,i}R_i^\top\bigr]-\mathbf d\,g_{\mathbf o}^\top,
# \end{aligned}
# $$


# %% tags=["transcription"]
def reverse_text(g_uv, g_abc, g_z_image, mu, R, S, camera, kappa):
    W = camera.rotation
    fx, fy = camera.fx, camera.fy
    _, _, z, (x, y, x_, y_, L_x, L_y, J, T) = project_text(mu, R, S, camera, kappa)
    (g_u, g_v), (g_a, g_b, g_c) = g_uv, g_abc
    G_2 = np.array([[g_a, g_b / 2], [g_b / 2, g_c]])
    M = T @ np.diag(S)
    g_M = 2 * G_2 @ M
    g_S = np.array([sum(T[r, k] * g_M[r, k] for r in range(2)) for k in range(3)])
    g_T = g_M @ np.diag(S)
    g_J, g_R = g_T @ (W @ R).T, (J @ W).T @ g_T
    g_x_, g_y_ = -fx / z**2 * g_J[0, 2], -fy / z**2 * g_J[1, 2]
    g_x = fx / z * g_u + (abs(x / z) <= L_x) * g_x_
    g_y = fy / z * g_v + (abs(y / z) <= L_y) * g_y_
    g_z = (
        g_z_image
        - (fx * x * g_u + fy * y * g_v) / z**2
        - fx / z**2 * g_J[0, 0]
        - fy / z**2 * g_J[1, 1]
    )
    g_z = g_z + 2 * fx * x_ / z**3 * g_J[0, 2] + 2 * fy * y_ / z**3 * g_J[1, 2]
    g_z = g_z + (abs(x / z) > L_x) * x_ / z * g_x_ + (abs(y / z) > L_y) * y_ / z * g_y_
    g_xyz = np.array([g_x, g_y, g_z])
    return W.T @ g_xyz, g_R, g_S, g_xyz, np.outer(g_xyz, mu) + J.T @ g_T @ R.T


# %%
g_uv, g_abc, g_z = rng.normal(size=(2, N)), rng.normal(size=(3, N)), rng.normal(size=N)
for settings in (PAPER, EXACT):
    _, saved = projection_forward(mu, shape, camera, settings)
    grads = projection_reverse(g_uv, g_abc, g_z, saved, pose_gradient=True)
    g_d, g_W = np.zeros(3), np.zeros((3, 3))
    for i in range(N):
        g_mu, g_R, g_S, g_xyz, part = reverse_text(
            g_uv[:, i],
            g_abc[:, i],
            g_z[i],
            mu[:, i],
            shape.rotation[:, :, i],
            shape.scale[:, i],
            camera,
            settings.jacobian_clamp,
        )
        np.testing.assert_allclose(grads.d_position[:, i], g_mu, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(grads.d_rotation[:, :, i], g_R, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(grads.d_scale[:, i], g_S, rtol=1e-9, atol=1e-10)
        g_d, g_W = g_d + g_xyz, g_W + part
    np.testing.assert_allclose(grads.d_camera.d_translation, g_d, rtol=1e-10)
    np.testing.assert_allclose(grads.d_camera.d_rotation, g_W, rtol=1e-10)

# %% [markdown]
# The direct form gives the same gradients as the form through $(a,b,c)$, with $g_a,g_b,g_c$ as printed in
# {doc}`08_compositing`:


# %% tags=["transcription"]
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
    S, (J, T) = (
        shape.scale[:, i],
        project_text(mu[:, i], shape.rotation[:, :, i], shape.scale[:, i], camera, 1.3)[3][-2:],
    )
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
# \alpha=\frac{\sin r}{r},\quad\beta=\frac{1-\cos r}{r^2},\\
# W'&=E\,W,\qquad\mathbf d'=E\,\mathbf d+\boldsymbol\tau .
# \end{aligned}
# $$
#
# The gradients with respect to $W'$ and $\mathbf d'$ are those that the projection returned above. Every entry of $E$
# depends on $\boldsymbol\omega$ through $[\boldsymbol\omega]_\times$ and through both factors, whose derivatives with
# respect to $\omega_i$ are $\omega_i\alpha'$ and $\omega_i\beta'$.


# %% tags=["transcription"]
def cross(w):
    """[w]_x"""
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def pose_text(W, d, omega, tau):
    """W' and d'."""
    r, K = np.linalg.norm(omega), cross(omega)
    alpha, beta = np.sin(r) / r, (1 - np.cos(r)) / r**2
    E = np.eye(3) + alpha * K + beta * K @ K
    return E @ W, E @ d + tau, (E, K, r, alpha, beta)


def pose_reverse_text(g_W, g_d, W, d, omega, E, K, r, alpha, beta):
    """g_W, g_d, g_omega and g_tau."""
    G = g_W @ W.T + np.outer(g_d, d)
    alpha_prime, beta_prime = (np.cos(r) - alpha) / r**2, (alpha - 2 * beta) / r**2
    g_omega = [
        ((alpha * G + beta * (G @ K.T + K.T @ G)) * cross(e)).sum()
        + omega[i] * (G * (alpha_prime * K + beta_prime * K @ K)).sum()
        for i, e in enumerate(np.eye(3))
    ]
    return E.T @ g_W, E.T @ g_d, g_omega, g_d


# %%
W, d, omega, tau = (
    camera.rotation,
    camera.translation,
    np.array([0.3, -0.2, 0.5]),
    np.array([0.1, 0.0, -0.2]),
)
*corrected, saved_pose = pose_forward(W, d, omega, tau)
*expected, factors = pose_text(W, d, omega, tau)
for array, text in zip(corrected, expected):
    np.testing.assert_allclose(array, text, rtol=1e-13)
found = pose_reverse(g_W, g_d, saved_pose)
for array, text in zip(found, pose_reverse_text(g_W, g_d, W, d, omega, *factors)):
    np.testing.assert_allclose(array, text, rtol=1e-11)

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
# Make everything twice as large: positions, semi-axes, the translation of the camera, the near plane. What happens to
# $(u,v)$, to $(a,b,c)$ and to $z$? What happens to the gradient with respect to the position? Write down your answer
# before you open the cell.

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. The screen does not change: x/z does not, and J halves while S doubles. z doubles.
# The gradient of the position halves (if no loss looks at z), because a step of one scene
# unit now means half as many pixels.
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
