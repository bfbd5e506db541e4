"""gsplat (Ye et al.) as a port: its reference in plain PyTorch, `gsplat.cuda._torch_impl`, which needs no GPU.

It answers the operations that it has: covariance, projection in preset paper (low-pass, near plane, clamp of the
Jacobian) and harmonics. Gradients are those of automatic differentiation. What it defines otherwise is left as it is:
the clamp at 0 and the 1/2 of the colour, which gsplat adds after its harmonics, are added here as its renderer does.
"""

import numpy as np
import torch
from exchange import serve
from gsplat.cuda import _torch_impl as gsplat


def leaf(array):
    """A tensor whose gradient is asked for."""
    return torch.tensor(np.array(array), requires_grad=True)


def gradients(outputs, given, leaves):
    """d_NAME of every leaf, from the given derivatives by the outputs."""
    total = sum((torch.tensor(d) * out).sum() for out, d in zip(outputs, given))
    found = torch.autograd.grad(total, list(leaves.values()), allow_unused=True)
    return {f"d_{name}": (torch.zeros_like(leaves[name]) if g is None else g).numpy() for name, g in zip(leaves, found)}


def covariance(i, settings):
    """Rotation of the normalised quaternion. The semi-axes come in as they are, so that it has no log-scale."""
    leaves = {"quaternion": leaf(i["quaternion"])}
    rotation = gsplat._quat_to_rotmat(leaves["quaternion"].T).permute(1, 2, 0)
    return {"rotation": rotation.detach().numpy()} | gradients((rotation,), (i["d_rotation"],), leaves)


def projection(i, settings):
    """Screen mean, covariance and depth. The covariance is that before its inverse is taken."""
    camera, raster = settings["camera"], settings["raster"]
    names = ("position", "rotation", "scale", "rotation_matrix", "translation")
    leaves = {name: leaf(i[name]) for name in names}
    kind = leaves["position"].dtype
    matrix = leaves["rotation"].permute(2, 0, 1) * leaves["scale"].T[:, None, :]
    shapes = matrix @ matrix.transpose(1, 2)
    view = torch.cat([torch.cat([leaves["rotation_matrix"], leaves["translation"][:, None]], 1),
                      torch.tensor([[0, 0, 0, 1]], dtype=kind)])  # fmt: skip
    lens = torch.tensor([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]], dtype=kind)
    size = camera["width"], camera["height"]
    centres, turned = gsplat._world_to_cam(leaves["position"].T, shapes, view[None])
    mean, cover = gsplat._persp_proj(centres, turned, lens[None], *size)
    cover = cover[0] + torch.eye(2, dtype=kind) * raster["low_pass"]
    seen = centres[0, :, 2] > raster["near"]
    zero = torch.zeros((), dtype=kind)
    out = (
        torch.where(seen, mean[0].T, zero),
        torch.where(seen, torch.stack([cover[:, 0, 0], cover[:, 0, 1], cover[:, 1, 1]]), zero),
        torch.where(seen, centres[0, :, 2], zero),
    )
    back = gradients(out, (i["d_mean2d"], i["d_covariance2d"], i["d_depth"]), leaves)
    values = [value.detach().numpy() for value in out]
    return dict(zip(("mean2d", "covariance2d", "depth"), values)) | {"visible": seen.numpy()} | back


def harmonics(i, settings):
    """Colour of a direction; the residual is added to the first coefficient."""
    names = ("harmonics", "residual", "position", "centre")
    leaves = {name: leaf(i[name]) for name in names}
    h = leaves["harmonics"]
    h = torch.cat([h[:1] + leaves["residual"], h[1:]])
    towards = (leaves["position"] - leaves["centre"][:, None]).T
    colour = gsplat._spherical_harmonics(settings["degree"], towards, h.permute(2, 0, 1))
    colour = torch.clamp_min(colour + 0.5, 0.0).T
    return {"colour": colour.detach().numpy()} | gradients((colour,), (i["d_colour"],), leaves)


OPERATIONS = {"covariance": covariance, "projection": projection, "harmonics": harmonics}


def answer(operation, inputs, settings):
    """gsplat's answer, None for what it does not have. It cannot be set to presets exact and legacy."""
    if operation not in OPERATIONS:
        return None
    return OPERATIONS[operation](inputs, settings) if settings.get("preset", "paper") == "paper" else {}


if __name__ == "__main__":
    serve(answer)
