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
# # 6. Quaternions, scales and the covariance
#
# A flat Gaussian can cover a piece of a wall, and a long one a piece of a vessel, for which many round ones would be
# needed. A Gaussian therefore has three semi-axes and a rotation. A gradient step can move a stored number to any real value, so both are stored in a form
# for which every real value is valid: the rotation as a quaternion of any length, and the semi-axes as logarithms.
#
# | Symbol | Meaning | Shape in the code |
# |---|---|---|
# | $\tilde q$ | stored quaternion, also called *raw*, in the order $(w,x,y,z)$, of any length | (4, N) |
# | $q=(w,\mathbf v)$ | the same with length 1; $\mathbf v=(x,y,z)$ | (4, N) |
# | $s$ | stored logarithms of the semi-axes | (3, N) |
# | $S=e^s$ | semi-axes at one standard deviation, in scene units | (3, N) |
# | $R$ | rotation; column $k$ is the direction of semi-axis $k$ | (3, 3, N) |
# | $\Sigma$ | covariance, in scene units squared | (3, 3, N) |
# | $[\mathbf v]_\times$ | matrix of the cross product: $[\mathbf v]_\times\mathbf a=\mathbf v\times\mathbf a$ | (3, 3) |
# | $g_X$ | gradient of the loss with respect to $X$ | that of $X$ |
#
# The equation is {eq}`eq-b2` of {doc}`/specification/b02_covariance`.

# %% tags=["hide-input"] mystnb={"code_prompt_show": "Imports", "code_prompt_hide": "Hide the imports"}

import matplotlib.pyplot as plt
import numpy as np

from endotsr.definition import covariance as definition
from endotsr.method.splatting.covariance import (
    Shape,
    covariance_forward,
    covariance_matrix,
    covariance_reverse,
)
from endotsr.port.gradcheck import (
    all_pairs,
    check_function,
    check_pair,
    one_thread,
    pair_stream,
    table,
)

# %%
rng = np.random.default_rng(5)
N = 6

# %% [markdown]
# ## The equation
#
# $$
# \begin{aligned}
# q&=\frac{\tilde q}{\|\tilde q\|},\qquad S_k=e^{s_k},\\
# R(q)&=\begin{bmatrix}
# 1-2(y^2+z^2) & 2(xy-wz) & 2(xz+wy)\\
# 2(xy+wz) & 1-2(x^2+z^2) & 2(yz-wx)\\
# 2(xz-wy) & 2(yz+wx) & 1-2(x^2+y^2)
# \end{bmatrix},\\
# \Sigma &= R\,\mathrm{diag}(S)^2R^\top .
# \end{aligned}
# $$
#
# A Gaussian with the centre $\mu$ has the value $\exp\bigl(-\tfrac12(\mathbf p-\mu)^\top\Sigma^{-1}(\mathbf p-\mu)\bigr)$ at
# the point $\mathbf p$. On the ellipsoid with the semi-axes $S_k$ along the columns of $R$ this is $e^{-1/2}$.
#
# Two kinds of input need a rule. In float32, the square of a scale overflows from a log-scale of about 44.4 on. A
# log-scale outside $[-40,40]$ is clipped to that interval. The zero quaternion has no direction and is taken as the
# identity $(1,0,0,0)$.
#
# `covariance_forward` returns $R$ and $S$ as a `Shape`, and not $\Sigma$. The compiled projection ({doc}`07_projection`)
# works with these two and does not form $\Sigma$. In float32, the short semi-axes of a needle, a Gaussian with one long
# and two short semi-axes, would lose their digits in the sums of $\Sigma$.
#
# <!-- definition: endotsr.definition.covariance.unit -->
# ```python
# def unit(quaternion):
#     """q / |q| (4, N) and 1 / |q| (N,), at most 1e20; (1, 0, 0, 0) and 0 for q = 0. The largest entry is divided out."""
#     largest = np.abs(quaternion.real).max(axis=0, initial=0)
#     zero = largest == 0
#     q = np.where(zero, np.eye(4)[:, :1], quaternion / np.where(zero, 1, largest))
#     norm = np.sqrt((q * q).sum(axis=0))
#     return q / norm, np.where(zero, 0, 1 / norm / np.maximum(largest, 1e-20))
# ```
#
# <!-- definition: endotsr.definition.covariance.rotation_of -->
# ```python
# def rotation_of(q):
#     """R (3, 3, N) of unit quaternions w + v: (w^2 - v.v) I + 2 v v^T + 2 w [v]_x; the kernel writes nine entries."""
#     w, v = q[0], q[1:]
#     outer = np.einsum("in,jn->ijn", v, v)
#     cross = np.einsum("ijk,kn->ijn", CROSS, v)
#     return (w * w - (v * v).sum(axis=0)) * np.eye(3)[:, :, None] + 2 * outer + 2 * w * cross  # (6.4)
# ```
#
# <!-- definition: endotsr.definition.covariance.covariance_forward -->
# ```python
# def covariance_forward(quaternion, log_scale):
#     """Equation (B2): Shape from raw quaternions (4, N) w, x, y, z and log-scales (3, N), clipped to +-40."""
#     # In float32 the square of e^44.4 overflows, and that of e^-44 is not a normal number.
#     scale = np.exp(np.where(np.abs(log_scale.real) > 40, np.copysign(40, log_scale.real), log_scale))
#     return Shape(rotation_of(unit(quaternion)[0]), scale), CovarianceSaved(quaternion, log_scale)
# ```
#
# <!-- definition: endotsr.definition.covariance.covariance_matrix -->
# ```python
# def covariance_matrix(shape):
#     """Sigma (3, 3, N), scene units squared. The kernels never form it: Sigma of a needle loses digits."""
#     return np.einsum("ikn,kn,jkn->ijn", shape.rotation, shape.scale**2, shape.rotation)
# ```

# %%
q, s = 3 * rng.normal(size=(4, N)), rng.normal(0, 0.7, (3, N))
shape, saved = covariance_forward(q, s)
text, _ = definition.covariance_forward(q, s)
np.testing.assert_allclose(shape.rotation, text.rotation, atol=1e-14)
np.testing.assert_allclose(shape.scale, text.scale, rtol=1e-14)
np.testing.assert_allclose(
    covariance_matrix(shape), definition.covariance_matrix(text), rtol=1e-11, atol=1e-13
)

# %% [markdown]
# The definition writes $R$ with the vector part $\mathbf v=(x,y,z)$ of the quaternion. For a unit quaternion the
# result equals the matrix of the display, because $w^2-\mathbf v\cdot\mathbf v=1-2\,\mathbf v\cdot\mathbf v$.

# %%
w, x, y, z = definition.unit(q)[0]
printed = [
    [1 - 2 * (y**2 + z**2), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x**2 + z**2), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x**2 + y**2)],
]
np.testing.assert_allclose(text.rotation, printed, atol=1e-14)

# %% [markdown]
# The next cell checks the rules. The length of the raw quaternion has no effect, even if its square would overflow or
# underflow. The quaternions $q$ and $-q$ give the same rotation. The zero quaternion gives the identity. It can occur,
# because the deformation model adds an offset to the stored quaternion.

# %%
for factor in (1e-300, 1e-30, -1.0, 1e300):
    np.testing.assert_allclose(
        covariance_forward(q / np.abs(q).max() * factor, s)[0].rotation,
        shape.rotation,
        atol=1e-14,
    )
assert np.array_equal(covariance_forward(0 * q, s)[0].rotation[:, :, 0], np.eye(3))
np.testing.assert_allclose(covariance_forward(q, s + 60)[0].scale, np.exp(40.0))
np.testing.assert_allclose(covariance_forward(q, s - 60)[0].scale, np.exp(-40.0))

# %% [markdown]
# ## The reverse pass, line by line
#
# Here $g_\Sigma$ is given, with all nine entries taken as independent, and we need the gradients with respect to the
# log-scales and to the raw quaternion.
#
# **(6.1) The product.** Let $M=R\,\mathrm{diag}(S)$. Then $\Sigma=MM^\top$, and
# $\mathrm d\Sigma=\mathrm dM\,M^\top+M\,\mathrm dM^\top$. Each entry of $M$ occurs in both factors, and its gradient
# is the sum of the two contributions: $g_M=(g_\Sigma+g_\Sigma^\top)M$.
#
# **(6.2) The two factors of $M$.** By definition $M_{jk}=R_{jk}S_k$. With $S$ held fixed, $g_{R_{jk}}=g_{M_{jk}}S_k$.
# With $R$ held fixed, a semi-axis scales one whole column of $M$, so $g_{S_k}=\sum_jR_{jk}\,g_{M_{jk}}$.
#
# **(6.3) The logarithm.** From $S_k=e^{s_k}$ follow $\mathrm dS_k=S_k\,\mathrm ds_k$ and $g_{s_k}=S_k\,g_{S_k}$. If a
# log-scale is clipped, $|s_k|>40$, a change of $s_k$ does not change $S_k$, and the gradient is 0. At exactly $\pm40$
# the gradient passes.
#
# $$
# g_M=(g_\Sigma+g_\Sigma^\top)M,\qquad g_{S_k}=\sum_j R_{jk}\,g_{M_{jk}},\qquad g_{s_k}=S_k\,g_{S_k},\qquad g_{R_{jk}}=g_{M_{jk}}S_k .
# $$
#
# **(6.4) The rotation.** With $q=(w,\mathbf v)$,
# $R=(w^2-\mathbf v\cdot\mathbf v)\,I+2\,\mathbf v\mathbf v^\top+2w\,[\mathbf v]_\times$. Each term is quadratic in $q$,
# so its differential has two parts:
# $\mathrm dR=2(w\,\mathrm dw-\mathbf v\cdot\mathrm d\mathbf v)\,I+2(\mathrm d\mathbf v\,\mathbf v^\top+\mathbf v\,\mathrm d\mathbf v^\top)+2\,\mathrm dw\,[\mathbf v]_\times+2w\,[\mathrm d\mathbf v]_\times$.
#
# **(6.5) Three contractions.** Let $G=g_R$. The change of the loss is
# $\langle G,\mathrm dR\rangle=\sum_{jk}G_{jk}\,\mathrm dR_{jk}$, in which each term of (6.4) becomes a number or a
# vector. The contraction with the identity is the trace, $\langle G,I\rangle=\tau=\sum_jG_{jj}$. The symmetric term
# gives
# $\langle G,\mathrm d\mathbf v\,\mathbf v^\top+\mathbf v\,\mathrm d\mathbf v^\top\rangle=\mathrm d\mathbf v\cdot(G+G^\top)\mathbf v$.
# The antisymmetric term gives $\langle G,[\mathbf a]_\times\rangle=\mathbf a\cdot\mathbf s$ for any vector
# $\mathbf a$, where $\mathbf s=(G_{21}-G_{12},\ G_{02}-G_{20},\ G_{10}-G_{01})$ is called the *spin*.
#
# **(6.6) The unit quaternion.** Collecting the factors of $\mathrm dw$ and of $\mathrm d\mathbf v$ gives
# $g_w=2w\tau+2\,\mathbf s\cdot\mathbf v$ and $g_{\mathbf v}=-2\tau\,\mathbf v+2(G+G^\top)\mathbf v+2w\,\mathbf s$.
#
# **(6.7) Two forms.** The display below differentiates the matrix as printed above, whose diagonal contains $1$ where
# (6.4) has $\|q\|^2$. Compared with (6.6), it lacks the gradient of $(\|q\|^2-1)\,\tau$, which is $2\tau q$. This
# vector points along $q$, and step (6.8) removes the component along $q$. Both forms therefore give the same
# $g_{\tilde q}$.
#
# **(6.8) The length.** From $q=\tilde q/\|\tilde q\|$ follows
# $\mathrm dq=(I-qq^\top)\,\mathrm d\tilde q/\|\tilde q\|$. A step of $\tilde q$ along itself does not change the
# rotation, so the component of $g_q$ along $q$ is removed. The same step rotates a longer $\tilde q$ by a smaller
# angle, so the rest is divided by the length. At $\tilde q=0$ the gradient is set to 0. If the largest entry of
# $\tilde q$ is below $10^{-20}$ in size, `unit` returns a smaller number than $1/\|\tilde q\|$, which keeps the gradient
# finite.
#
# In the program, steps (6.1) and (6.2) belong to the reverse pass of the projection, (7.2) to (7.4).
# `covariance_reverse` starts from $g_R$ and $g_S$, at (6.3).
#
# In the display the indices of $G$ count from 0, as in the code.
#
# $$
# \begin{aligned}
# g_w&=2\bigl[x(G_{21}-G_{12})+y(G_{02}-G_{20})+z(G_{10}-G_{01})\bigr]\\
# g_x&=2\bigl[-2x(G_{11}+G_{22})+y(G_{01}+G_{10})+z(G_{02}+G_{20})+w(G_{21}-G_{12})\bigr]\\
# g_y&=2\bigl[x(G_{01}+G_{10})-2y(G_{00}+G_{22})+z(G_{12}+G_{21})+w(G_{02}-G_{20})\bigr]\\
# g_z&=2\bigl[x(G_{02}+G_{20})+y(G_{12}+G_{21})-2z(G_{00}+G_{11})+w(G_{10}-G_{01})\bigr]\\
# g_{\tilde q}&=\frac{g_q-(q\cdot g_q)\,q}{\|\tilde q\|}
# \end{aligned}
# $$
#
# <!-- definition: endotsr.definition.covariance.rotation_reverse -->
# ```python
# def rotation_reverse(q, g):
#     """From g = dL/dR (3, 3, N) to the unit quaternions (4, N).
#
#     That of the printed nine entries is less by 2 trace(g) q, and (6.8) removes any multiple of q.
#     """
#     w, v = q[0], q[1:]
#     trace = np.einsum("iin->n", g)
#     spin = np.einsum("ijn,ijk->kn", g, CROSS)  # (6.5)
#     along = np.einsum("ijn,jn->in", g + g.transpose(1, 0, 2), v)  # (6.6)
#     g_w = 2 * w * trace + 2 * (spin * v).sum(axis=0)
#     g_v = -2 * v * trace + 2 * along + 2 * w * spin
#     return np.concatenate([[g_w], g_v])
# ```
#
# <!-- definition: endotsr.definition.covariance.covariance_reverse -->
# ```python
# def covariance_reverse(d_shape, saved):
#     """Reverse of (B2): the component along q is removed; a clipped log-scale has gradient 0."""
#     q, inverse_norm = unit(saved.quaternion)
#     g = rotation_reverse(q, d_shape.rotation)
#     d_quaternion = (g - (g * q).sum(axis=0) * q) * inverse_norm  # (6.8)
#     free = np.abs(saved.log_scale) <= 40  # (6.3)
#     scale = np.exp(np.clip(saved.log_scale, -40, 40))
#     return CovarianceGrads(d_quaternion, np.where(free, d_shape.scale * scale, 0))
# ```


# %%
def from_sigma(g_Sigma, R, S):
    """(6.1) and (6.2): g_R and g_S of one Gaussian."""
    g_M = (g_Sigma + g_Sigma.T) @ (R * S)
    return g_M * S, (R * g_M).sum(axis=0)


g_Sigma = rng.normal(size=(3, 3, N))
pairs = [
    from_sigma(g_Sigma[:, :, i], shape.rotation[:, :, i], shape.scale[:, i]) for i in range(N)
]
g_R, g_S = (np.stack(parts, axis=-1) for parts in zip(*pairs))
grads = covariance_reverse(Shape(g_R, g_S), saved)
for found, expected in zip(
    grads,
    definition.covariance_reverse(definition.Shape(g_R, g_S), definition.CovarianceSaved(q, s)),
):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)

# The printed form, line by line, differs from (6.6) along q alone: by 2 tau q, as (6.7) says.
G, unit = g_R, definition.unit(q)[0]
w, x, y, z = unit
g_w = 2 * (x * (G[2, 1] - G[1, 2]) + y * (G[0, 2] - G[2, 0]) + z * (G[1, 0] - G[0, 1]))
g_x = 2 * (
    -2 * x * (G[1, 1] + G[2, 2])
    + y * (G[0, 1] + G[1, 0])
    + z * (G[0, 2] + G[2, 0])
    + w * (G[2, 1] - G[1, 2])
)
g_y = 2 * (
    x * (G[0, 1] + G[1, 0])
    - 2 * y * (G[0, 0] + G[2, 2])
    + z * (G[1, 2] + G[2, 1])
    + w * (G[0, 2] - G[2, 0])
)
g_z = 2 * (
    x * (G[0, 2] + G[2, 0])
    + y * (G[1, 2] + G[2, 1])
    - 2 * z * (G[0, 0] + G[1, 1])
    + w * (G[1, 0] - G[0, 1])
)
tau = np.einsum("jji->i", G)
lacking = definition.rotation_reverse(unit, G) - np.array([g_w, g_x, g_y, g_z])
np.testing.assert_allclose(lacking, 2 * tau * unit, atol=1e-12)

along = np.abs((q * grads.d_quaternion).sum(axis=0)) / np.linalg.norm(
    grads.d_quaternion, axis=0
)
assert along.max() < 1e-12, "a gradient along the quaternion would change nothing"
np.testing.assert_allclose(
    covariance_reverse(Shape(g_R, g_S), covariance_forward(5 * q, s)[1]).d_quaternion,
    grads.d_quaternion / 5,
)
# The two rules: no gradient at the zero quaternion, none of a clipped log-scale.
at_zero, clipped = covariance_forward(0 * q, s)[1], covariance_forward(q, s + 60)[1]
assert not covariance_reverse(Shape(g_R, g_S), at_zero).d_quaternion.any()
assert not covariance_reverse(Shape(g_R, g_S), clipped).d_log_scale.any()
for limit in (-40.0, 40.0):
    at_limit = covariance_forward(q, 0 * s + limit)[1]
    assert covariance_reverse(Shape(g_R, g_S), at_limit).d_log_scale.all(), "it passes at +-40"

# %% [markdown]
# ## Figure: a shape found by its gradient
#
# Can these gradients alone turn a nearly round Gaussian into a long, rotated one? Let $\Sigma^\star$ be the covariance
# of the target. The next cell minimises $\|\Sigma-\Sigma^\star\|^2$ by plain gradient steps through the reverse pass,
# which starts from $g_\Sigma=2(\Sigma-\Sigma^\star)$.

# %% tags=["hide-input"]
q_now, s_now = np.array([[1.0], [0.1], [0.2], [0.1]]), np.log([[0.6], [0.5], [0.55]])
target = covariance_matrix(
    covariance_forward(np.array([[0.9], [0.3], [-0.2], [0.6]]), np.log([[1.4], [0.7], [0.2]]))[
        0
    ]
)[:, :, 0]
path, losses = [], []
for _ in range(800):
    shape_now, saved_now = covariance_forward(q_now, s_now)
    difference = covariance_matrix(shape_now)[:, :, 0] - target
    losses.append((difference**2).sum())
    path.append(covariance_matrix(shape_now)[:, :, 0])
    back = from_sigma(2 * difference, shape_now.rotation[:, :, 0], shape_now.scale[:, 0])
    step = covariance_reverse(Shape(*(part[..., None] for part in back)), saved_now)
    q_now, s_now = q_now - 0.05 * step.d_quaternion, s_now - 0.05 * step.d_log_scale
assert losses[-1] < 1e-3 * losses[0]

circle = np.stack(
    [np.cos(np.linspace(0, 2 * np.pi, 100)), np.sin(np.linspace(0, 2 * np.pi, 100))]
)
figure = plt.figure(figsize=(10.1, 3.3), layout="constrained")
for column, (a, b) in enumerate(((0, 1), (0, 2))):
    panel = figure.add_subplot(1, 3, column + 1)
    for k in (0, 4, 8, 16, 32, 64, 128, 799):
        factor = np.linalg.cholesky(path[k][np.ix_([a, b], [a, b])])
        panel.plot(*(factor @ circle), color=plt.cm.viridis(np.log1p(k) / 6), lw=1.2)
    panel.plot(*(np.linalg.cholesky(target[np.ix_([a, b], [a, b])]) @ circle), "r--", lw=1.5)
    panel.set(title="outline: start dark, target red", xlabel="xyz"[a], ylabel="xyz"[b])
    panel.set_aspect("equal")
panel = figure.add_subplot(1, 3, 3, projection="3d")
u, v = np.mgrid[0 : 2 * np.pi : 40j, 0 : np.pi : 20j]
ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
final, _ = covariance_forward(q_now, s_now)
x, y, z = np.einsum("jk,k,kuv->juv", final.rotation[:, :, 0], final.scale[:, 0], ball)
panel.plot_surface(x, y, z, cmap="viridis", alpha=0.9, lw=0)
for k in range(3):
    axis = final.rotation[:, k, 0] * final.scale[k, 0] * 1.3
    panel.plot(*np.stack([-axis, axis], axis=1), color="k", lw=1)
panel.set(title=f"the fitted shape, loss {losses[-1]:.0e}", aspect="equal")
plt.show()

# %% [markdown]
# ## The gradient check
#
# The function `check_function` takes any pair of a forward and a reverse function. The first check covers the whole
# chain through $\Sigma$ as derived above, and the second the pair `covariance` of `endotsr gradcheck`.


# %%
def sigma_forward(inputs):
    return covariance_matrix(covariance_forward(inputs["quaternion"], inputs["log_scale"])[0])


def sigma_reverse(inputs, g):
    shape, saved = covariance_forward(inputs["quaternion"], inputs["log_scale"])
    parts = [
        from_sigma(g[:, :, i], shape.rotation[:, :, i], shape.scale[:, i]) for i in range(N)
    ]
    grads = covariance_reverse(Shape(*(np.stack(p, axis=-1) for p in zip(*parts))), saved)
    return {"quaternion": grads.d_quaternion, "log_scale": grads.d_log_scale}


with one_thread():
    reports = [
        check_function(
            sigma_forward,
            sigma_reverse,
            {"quaternion": q, "log_scale": s},
            label=("Sigma", "B2", ""),
        ),
        check_pair(all_pairs()["covariance"], pair_stream("covariance", 0)),
    ]
print(table(reports))
assert all(report.passed for report in reports)

# %% [markdown]
# ## Exercise
#
# 1. The three semi-axes are equal. What is $g_{\tilde q}$ for any symmetric $g_\Sigma$? Use (6.1), (6.2), and
#    $\mathrm dR=[\mathrm d\theta]_\times R$ for a rotation by the small vector $\mathrm d\theta$.
# 2. Write `covariance_reverse` from (6.3), (6.6) and (6.8) and let the golden cases judge it: `--only covariance`
#    ({doc}`index`). Why does every case fail if the division by the length is omitted?
# 3. The cell below answers this one. Change the order of the axes of a Gaussian: its log-scales become $(s_2,s_3,s_1)$
#    instead of $(s_1,s_2,s_3)$. Which quaternion gives the same $\Sigma$ as before? How many sets of parameters
#    describe one ellipsoid with three different semi-axes?

# %% jupyter={"source_hidden": true} tags=["hide-cell"]
# Answer. R' = R P with P the third of a turn that sends axis 1 to axis 2, 2 to 3 and 3 to 1:
# the quaternion product q (1, 1, 1, 1)/2. A right-handed frame can be laid along the
# three axes in 24 ways, the rotations of a cube; each has two quaternions, so 48 sets (times
# all lengths).
w, x, y, z = q[:, 0]
p = np.array([0.5, 0.5, 0.5, 0.5])
product = np.array(
    [
        w * p[0] - x * p[1] - y * p[2] - z * p[3],
        w * p[1] + x * p[0] + y * p[3] - z * p[2],
        w * p[2] - x * p[3] + y * p[0] + z * p[1],
        w * p[3] + x * p[2] - y * p[1] + z * p[0],
    ]
)
same = covariance_matrix(covariance_forward(product[:, None], s[[1, 2, 0], :1])[0])[:, :, 0]
np.testing.assert_allclose(same, covariance_matrix(shape)[:, :, 0], atol=1e-12)
