"""The named defects: mistakes that a port could make, each as a change of the source."""

from collections.abc import Callable
from typing import NamedTuple

from mutation.mutator import Mutant, replaced

DEFECT = "named defect"


class Defect(NamedTuple):
    """One mistake in one function; every `old` occurs in its source exactly once."""

    name: str
    kernel: str
    changes: tuple[tuple[str, str], ...]


def _rotation_transposed() -> tuple[tuple[str, str], ...]:
    """w -> -w in the matrix entries gives the inverse rotation."""
    terms = (("x * y", "w * z"), ("x * z", "w * y"), ("y * z", "w * x"))
    signs = ((" - ", " + "), (" + ", " - "), (" - ", " + "))
    out = []
    for (product, real_part), (upper, lower) in zip(terms, signs):
        out.append((f"two * ({product}{upper}{real_part})", f"two * ({product}{lower} {real_part})"))
        out.append((f"two * ({product}{lower}{real_part})", f"two * ({product}{upper} {real_part})"))
    return tuple(out)


D_Z = ("inverse_z2 * (through_x + through_y)", "zero")
CAMERA, CAMERA_REVERSE = "method.splatting.camera_model.pinhole", "method.splatting.camera_model.pinhole_reverse"
SCREEN = "method.splatting.projection_formulas.screen_covariance"
COMPOSITE, COMPOSITE_REVERSE = (
    "method.splatting.compositing._composite",
    "method.splatting.compositing._composite_reverse",
)
BLOCK_REVERSE = "method.splatting.fast.blocks._blend_block_reverse"

DEFECTS: tuple[Defect, ...] = (
    Defect(
        "d covariance / d mean frozen",
        CAMERA_REVERSE,
        (
            ("-lens.fx * inverse_z2 * d_j02 if free_x else zero", "zero"),
            ("-lens.fy * inverse_z2 * d_j12 if free_y else zero", "zero"),
            D_Z,
        ),
    ),
    Defect("dJ/dz frozen", CAMERA_REVERSE, (D_Z,)),
    Defect(
        "clamped dJ/dz twice too large",
        CAMERA_REVERSE,
        (("power_x = two if free_x else lens.clamp_factor", "power_x = two"),),
    ),
    Defect(
        "off-diagonal gradient halved",
        "method.splatting.records._gather",
        (("factor * (a * total[SUM_SEY])", "half * factor * (a * total[SUM_SEY])"),),
    ),
    Defect(
        "gradient of depth by z dropped",
        "method.splatting.records._gather",
        (("total[SUM_DEPTH] if keep_depth else zero", "zero"),),
    ),
    Defect("background dropped", COMPOSITE, tuple((f" + t * background[{k}]", "") for k in range(3))),
    Defect(
        "background dropped from the gradient",
        COMPOSITE_REVERSE,
        (("g0 * background[0] + g1 * background[1] + g2 * background[2]", "zero"),),
    ),
    Defect(
        "quaternion gradient without its normalisation",
        "method.splatting.covariance.unit_quaternion_reverse",
        tuple((f"(d_{k} - along * {k})", f"d_{k}") for k in "wxyz"),
    ),
    Defect(
        "alpha clamp .99 forward, .999 in reverse",
        COMPOSITE_REVERSE,
        (("alpha = min(value, alpha_max)", "alpha = min(value, real(0.999) if alpha_max < one else alpha_max)"),),
    ),
    Defect(
        "alpha clamp .99 forward, .999 in reverse (fast path)",
        BLOCK_REVERSE,
        (("alpha = min(value, alpha_max)", "alpha = min(value, real(0.999))"),),
    ),
    Defect(
        "final T in place of T_i",
        "method.splatting.compositing._pixel_reverse",
        (("alpha, t, e, dy = kept[j, 0], kept[j, 1]", "alpha, t, e, dy = kept[j, 0], kept[hit.size - 1, 1]"),),
    ),
    Defect("sign of dy", "method.splatting.compositing._alpha", (("dy = y - record[V]", "dy = record[V] - y"),)),
    Defect(
        "sign of dy in the fast reverse pass", BLOCK_REVERSE, (("se, sy = s * e, s * dy", "se, sy = s * e, -s * dy"),)
    ),
    Defect("rotation transposed", "method.splatting.covariance.rotation_of", _rotation_transposed()),
    Defect(
        "fx and fy exchanged",
        CAMERA,
        (
            (
                "u, v = lens.fx * slope_x + lens.cx, lens.fy * slope_y + lens.cy",
                "u, v = lens.fy * slope_x + lens.cx, lens.fx * slope_y + lens.cy",
            ),
        ),
    ),
    Defect(
        "low-pass dropped",
        SCREEN,
        (("a = low_pass + u0 * u0", "a = u0 * u0"), ("c = low_pass + v0 * v0", "c = v0 * v0")),
    ),
    Defect("determinant as a c - b b", SCREEN, (("low_pass * low_pass + low_pass * spread + areas", "a * c - b * b"),)),
    Defect(
        "atom statistics from all time stamps",
        "training.fitting.state.training_constants",
        (("sequence.times[sequence.train_index]", "sequence.times"),),
    ),
    Defect(
        "beta missing",
        "method.equations.appearance.appearance_forward",
        (("dtype.type(beta / Y00)", "dtype.type(1 / Y00)"),),
    ),
    Defect(
        "1/Y00 missing",
        "method.equations.appearance.appearance_forward",
        (("dtype.type(beta / Y00)", "dtype.type(beta)"),),
    ),
    Defect(
        "rho not normalised to mean 1",
        "method.equations.matern.matern_weights",
        (("density / (math.fsum(density) / density.size)", "density"),),
    ),
    Defect(
        "mask applied before the pyramid only",
        "method.equations.laplacian.support_masks",
        (
            ("valid & _expand_support(coarse, valid.shape, upsampling)", "valid"),
            ("_reduce_support(valid)", "valid[::2, ::2]"),
        ),
    ),
    Defect(
        "zero padding of the pyramid",
        "method.equations.pyramid._reduce_row",
        (
            ("inside[reflect(-2, w)]", "real(0.0)"),
            ("inside[reflect(-1, w)]", "real(0.0)"),
            ("inside[reflect(x, w)]", "real(0.0)"),
        ),
    ),
    Defect(
        "half-pixel up-sampling whatever is asked for",
        "method.equations.pyramid.expand_weights",
        (("return EXPAND_WEIGHTS[upsampling]", 'return EXPAND_WEIGHTS["half_pixel"]'),),
    ),
    Defect(
        "L1 averaged over all pixels",
        "method.losses.masked_l1.masked_l1_forward",
        (("rendered.shape[0] * int(np.count_nonzero(mask))", "rendered.size"),),
    ),
    Defect(
        "SSIM averaged over all pixels",
        "method.losses.masked_ssim.ssim_target",
        (("observed.shape[0] * int(np.count_nonzero(mask))", "observed.size"),),
    ),
    Defect(
        "place in the list taken for the index of the Gaussian",
        "method.splatting.records._gather",
        (("i = order[k]", "i = k"),),
    ),
    Defect(
        "sum depends on the ranges of the threads",
        "method.losses.masked_l1._absolute_difference",
        (
            ("for index in range(first, stop):", "totals[first:stop] = 0\n    for index in range(first, stop):"),
            ("totals[index] = row_total(line)", "totals[first] += row_total(line)"),
        ),
    ),
    Defect(
        "equal depths in reverse index order",
        "method.splatting.binning._radix_order",
        (
            (
                "for i in range(key.size):\n        if visible[i]:\n            keys[m]",
                "for i in range(key.size - 1, -1, -1):\n        if visible[i]:\n            keys[m]",
            ),
        ),
    ),
)


def defect_mutants(functions: dict[str, Callable]) -> list[Mutant]:
    """The defects as mutants of the current source. Raises ValueError where the source has changed."""
    return [Mutant(d.kernel, DEFECT, d.name, replaced(functions[d.kernel], *d.changes)) for d in DEFECTS]
