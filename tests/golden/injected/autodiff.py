"""Single mistakes for the port by automatic differentiation: the flag, and the old and new text of its source.

Its reverse pass follows its forward pass, so that every mistake is made in both.
"""

from pathlib import Path

Injected = tuple[str, tuple[tuple[str, str], ...]]

SOURCE = Path(__file__).parents[3] / "golden" / "ports" / "torch" / "port.py"
MISTAKES: list[Injected] = [
    (
        "atoms_interleaved",
        (
            (
                "torch.cat([torch.sin(phase), torch.cos(phase)])",
                "torch.stack([torch.sin(phase), torch.cos(phase)], 1).reshape(-1)",
            ),
        ),
    ),
    (
        "frequency_without_two_pi",
        (("phase = 2 * math.pi * (phase - torch.round(phase).detach())", "phase = phase + 0"),),
    ),
    ("missing_y00", (('s["beta"] / Y00', 's["beta"]'),)),
    ("tanh_missing", (("torch.tanh(argument)", "argument"),)),
    ("matern_without_two_pi", (('s["correlation_length"] * 2 * math.pi', 's["correlation_length"]'),)),
    ("penalty_over_two", (("c**2).sum() / c.numel()", "c**2).sum() * 3 / c.numel()"),)),
    ("basis_gaussian_without_half", (("torch.exp(-u / 2)", "torch.exp(-u)"),)),
    ("rotation_vector_reversed", (('= i["rotation_vector"]', '= -i["rotation_vector"]'),)),
    ("rotation_after_pose", (('e @ i["rotation"]', 'i["rotation"] @ e'),)),
    ("gain_not_exponential", (('torch.exp(i["log_gain"])', '(1 + i["log_gain"])'),)),
    (
        "exposure_clamped",
        (
            (
                'i["bias"][:, None, None]}',
                'i["bias"][:, None, None]}\n    return {"exposed": made["exposed"].clamp(0, 1)}',
            ),
            ('    return {"exposed": torch.exp', '    made = {"exposed": torch.exp'),
        ),
    ),
    ("l1_over_all_pixels", (('max(3 * int(i["mask"].sum()), 1)', "x.numel()"),)),
    ("l1_sum_over_channels", (('max(3 * int(i["mask"].sum()), 1)', 'max(int(i["mask"].sum()), 1)'),)),
    ("sign_of_zero", (("(x - y).abs()", "torch.where(x >= y, x - y, y - x)"),)),
    ("ssim_over_all_pixels", (('similarity[:, i["mask"]].mean()', "similarity.mean()"),)),
    (
        "ssim_window_7",
        (
            ("torch.arange(-5, 6, dtype", "torch.arange(-3, 4, dtype"),
            ("padding=(5, 0)", "padding=(3, 0)"),
            ("padding=(0, 5)", "padding=(0, 3)"),
        ),
    ),
    ("ssim_box_window", (("w = torch.exp(-(k**2) / (2 * 1.5**2))", "w = torch.ones_like(k)"),)),
    ("depth_maximum_constant", (("torch.amax(depth)", "torch.amax(depth).detach()"),)),
    ("depth_first_maximum", (("torch.amax(depth)", "depth.reshape(-1)[depth.argmax()]"),)),
    (
        "depth_maximum_of_tissue",
        (("torch.amax(depth), prior[known].max()", 'torch.amax(depth[i["mask"]]), prior[valid].max()'),),
    ),
    ("depth_few_priors", (("int(valid.sum()) < 10", "int(valid.sum()) < 1"),)),
    ("edges_ignored", (('(mask & ~i["edges"])', "mask"),)),
    (
        "variation_of_tissue",
        (
            (
                "torch.where(mask, torch.zeros_like(picture), picture)",
                "torch.where(~mask, torch.zeros_like(picture), picture)",
            ),
        ),
    ),
    ("squared_steps_over_all_pixels", (("(v.sum() + 1e-6)", "v.numel()"),)),
    ("zero_quaternion", (("torch.where(zero, torch.tensor([[1.0], [0], [0], [0]], dtype=raw.dtype), raw)", "raw"),)),
    ("quaternion_xyzw", (("w, x, y, z = safe / safe.norm(dim=0)", "x, y, z, w = safe / safe.norm(dim=0)"),)),
    ("quaternion_not_normalised", (("safe / safe.norm(dim=0)", "safe"),)),
    ("log_scale_not_clipped", ((".clamp(-40, 40)", ""),)),
    ("jacobian_clamp_missing", (('if r["jacobian_clamp"] > 0:', "if False:"),)),
    ("near_plane_zero", (('p[2] > r["near"]', "p[2] > 0"),)),
    (
        "shape_rotation_ignored",
        (
            (
                'i["rotation_matrix"], i["rotation"])',
                'i["rotation_matrix"], torch.eye(3, dtype=z.dtype)[:, :, None] + 0 * i["rotation"])',
            ),
        ),
    ),
    (
        "jacobian_gradient_dropped",
        (('torch.einsum("ajn,jk,kln->aln", jacobian', 'torch.einsum("ajn,jk,kln->aln", jacobian.detach()'),),
    ),
    ("direction_gradient_dropped", (("x, y, z = v / v.norm(dim=0)", "x, y, z = (v / v.norm(dim=0)).detach()"),)),
    ("colour_clamped_above", (("torch.zeros_like(value))}", "torch.zeros_like(value)).clamp(max=1)}"),)),
    ("residual_not_scaled", (('Y00 * (h[0] + i["residual"])', 'Y00 * h[0] + i["residual"]'),)),
    ("order_by_index", (("torch.argsort(z.detach(), stable=True).tolist()", "range(len(z))"),)),
    (
        "depth_over_opacity",
        (('"depth_image": depth,', '"depth_image": depth / torch.where(total > 0, total, torch.ones_like(total)),'),),
    ),
    (
        "background_missing",
        (("image = image + left * background[:, None, None]", "image = image + 0 * left * background[:, None, None]"),),
    ),
    (
        "alpha_clamp_999",
        (
            (
                'alpha = torch.where(value > raster["alpha_max"], torch.full_like(value, raster["alpha_max"]), value)',
                'alpha = value.clamp(max=max(0.999, raster["alpha_max"]))',
            ),
        ),
    ),
    ("stop_missing", (('< raster["transmittance_stop"])', "< 0)"),)),
    ("depth_gradient_dropped", (("depth + weight * z[n]", "depth + weight * z[n].detach()"),)),
    (
        "optical_centre_is_translation",
        (('centre = -i["rotation_matrix"].T @ i["translation"]', 'centre = i["translation"]'),),
    ),
    (
        "view_direction_not_to_pose",
        (
            (
                'centre = -i["rotation_matrix"].T @ i["translation"]',
                'centre = (-i["rotation_matrix"].T @ i["translation"]).detach()',
            ),
        ),
    ),
]
