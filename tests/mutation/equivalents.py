"""Mutants that compute the same as the right source, listed by hand with the reason.

A name stands here as the report prints it. A test refuses names that no mutant of today's source has.
"""

from typing import NamedTuple


class Group(NamedTuple):
    """Mutants that are equivalent for one reason."""

    reason: str
    names: tuple[str, ...]


EQUIVALENT: tuple[Group, ...] = (
    Group(
        "NumPy's geomspace sets both ends to the last bit already; the statements do not rely on it.",
        (
            "equations.fourier.frequencies: `omega[-1] = high if count > 1 else low` dropped",
            "equations.fourier.frequencies: `omega[0] = low` dropped",
        ),
    ),
    Group(
        "One more task, which finds nothing to do.",
        (
            "equations.atom_sums._blocks: `n + BLOCK - 1` -> `n + BLOCK` in `return (n + BLOCK - 1) // BLOCK`",
            "equations.atom_sums._blocks: `n + BLOCK - 1` -> `n + BLOCK + 1` in `return (n + BLOCK - 1) // BLOCK`",
            "fitting.adam.adam_step: `(p.size + PIECE - 1) // PIECE` -> `(p.size + PIECE - 1) * PIECE` in `tasks "
            "= (p.size + PIECE - 1) // PIECE`",
            "fitting.adam.adam_step: `p.size + PIECE - 1` -> `p.size + PIECE + 1` in `tasks = (p.size + PIECE - "
            "1) // PIECE`",
            "fitting.adam.adam_step: `p.size + PIECE - 1` -> `p.size + PIECE` in `tasks = (p.size + PIECE - 1) // "
            "PIECE`",
            "splatting.projection.projection_reverse_footprint: `(n + BLOCK - 1) // BLOCK` -> `(n + BLOCK - 1) * "
            "BLOCK` in `d_poses = np.zeros(((n + BLOCK - 1) // BLOCK, 3 if pose_gradient else 0, 4), dtype)`",
            "splatting.projection.projection_reverse_footprint: `n + BLOCK - 1` -> `n + BLOCK` in `d_poses = "
            "np.zeros(((n + BLOCK - 1) // BLOCK, 3 if pose_gradient else 0, 4), dtype)`",
            "splatting.harmonics.harmonics_reverse: `n + BLOCK - 1` -> `n + BLOCK + 1` in `d_centres = "
            "np.zeros(((n + BLOCK - 1) // BLOCK, 3), dtype)`",
            "splatting.harmonics.harmonics_reverse: `n + BLOCK - 1` -> `n + BLOCK` in `d_centres = np.zeros(((n + "
            "BLOCK - 1) // BLOCK, 3), dtype)`",
            "splatting.harmonics.harmonics_forward: `position.shape[1] + BLOCK - 1` -> `position.shape[1] + BLOCK "
            "+ 1` in `blocks = (position.shape[1] + BLOCK - 1) // BLOCK`",
            "splatting.harmonics.harmonics_forward: `position.shape[1] + BLOCK - 1` -> `position.shape[1] + "
            "BLOCK` in `blocks = (position.shape[1] + BLOCK - 1) // BLOCK`",
            "splatting.compositing.composite_forward: `lists.starts.size - 1` -> `lists.starts.size + 1` in "
            "`share(_composite_kernel, lists.starts.size - 1, records, lists.starts, lists.ranks, limits, "
            "background, *out)`",
            "splatting.compositing.composite_forward: `lists.starts.size - 1` -> `lists.starts.size` in "
            "`share(_composite_kernel, lists.starts.size - 1, records, lists.starts, lists.ranks, limits, "
            "background, *out)`",
            "splatting.projection.projection_reverse_footprint: `n + BLOCK - 1` -> `n + BLOCK + 1` in `d_poses = "
            "np.zeros(((n + BLOCK - 1) // BLOCK, 3 if pose_gradient else 0, 4), dtype)`",
            "equations.deformation._forward: `count + PIECE - 1` -> `count + PIECE` in `pieces = (count + PIECE - "
            "1) // PIECE`",
        ),
    ),
    Group(
        "At equality both sides of the choice are the same number.",
        (
            "equations.appearance._exp_nonpositive: `z > real(SATURATED)` -> `z >= real(SATURATED)` in `z = "
            "real(SATURATED) if z > real(SATURATED) else z`",
            "fitting.schedules.detail_share: `iteration >= config.loss.detail_full` -> `iteration > "
            "config.loss.detail_full` in `if iteration >= config.loss.detail_full`",
            "equations.matern.matern_weights: `scaled >= math.sqrt(5.0)` -> `scaled > math.sqrt(5.0)` in `if "
            "scaled >= math.sqrt(5.0)`",
            "scene.density_control._choose: `candidates.size > room` -> `candidates.size >= room` in `if "
            "candidates.size > room`",
            "scene.density_control._fainter_than: `opacity < 1.0` -> `opacity <= 1.0` in `bound = np.log(opacity) "
            "- np.log1p(-opacity) if opacity < 1.0 else np.inf`",
            "equations.calibration.calibration_views: `count <= 0` -> `count < 0` in `if n_train <= 0 or count <= 0`",
            "equations.fourier.frequencies: `count > 1` -> `count >= 1` in `omega[-1] = high if count > 1 else low`",
            "equations.deformation._add_row: `u > far` -> `u >= far` in `u = far if u > far else u`",
            "equations.deformation._reverse_row: `u > far` -> `u >= far` in `u = far if u > far else u`",
            "fitting.adam._adam_row: `abs(m) < tiny` -> `abs(m) <= tiny` in `m = real(0) if abs(m) < tiny else m`",
            "splatting.records._gather: `conic_epsilon > zero` -> `conic_epsilon >= zero` in `if conic_epsilon > zero`",
            "splatting.projection._project_reverse: `scale[k, i] * length <= axis_limit` -> `scale[k, i] * length "
            "< axis_limit` in `s[k] = scale[k, i] if scale[k, i] * length <= axis_limit else axis_limit / length`",
            "splatting.projection._project: `s[k] * length > axis_limit` -> `s[k] * length >= axis_limit` in `if "
            "s[k] * length > axis_limit`",
        ),
    ),
    Group(
        "Scratch memory, or an array without a column, larger than what is read of it.",
        (
            "losses.smoothness._variation: `3` -> `4` in `scratch = np.empty((3, width), image.dtype)`",
            "fitting.deformation_step.deformation_adam_step: `3` -> `4` in `root = np.empty(3)`",
            "equations.pyramid._reduce: `2` -> `3` in `pairs = np.empty((m + 2, 2), fine.dtype)`",
            "equations.pyramid._expand: `2` -> `3` in `blend = np.empty(m + 2, coarse.dtype)`",
            "splatting.render.render_forward: `3` -> `4` in `back = np.zeros(3, dtype) if background is None else "
            "np.ascontiguousarray(background, dtype)`",
            "splatting.harmonics.harmonics_forward: `3` -> `4` in `extra = np.empty((3, 0), dtype) if residual is "
            "None else residual`",
            "splatting.compositing_rows.composite_rows_reverse: `0` -> `1` in `extra = np.empty((0, 0), dtype) if "
            "d_opacity is None else d_opacity` (2)",
            "equations.pyramid._table: `1` -> `2` in `starts = np.searchsorted(owners, np.arange(targets + 1))`",
            "splatting.binning._radix_order: `1` -> `2` in `histogram = np.empty(1 << _RADIX_BITS, np.int64)`",
            "losses.similarity.masked_ssim_forward: `3` -> `4` in `slopes = np.empty((3, *padded), rendered.dtype)`",
            "splatting.binning.tile_lists: `1` -> `2` in `counts, pair_starts = (np.zeros((CHUNKS, tiles_x * "
            "tiles_y), np.int64), np.zeros(n + 1, np.int64))`",
            "losses.smoothness._variation_reverse: `3` -> `4` in `rows = np.empty((3, width + 2), image.dtype)`",
            "losses.smoothness._variation_reverse: `2` -> `3` in `rows = np.empty((3, width + 2), image.dtype)`",
            "fitting.deformation_step._step: `3` -> `4` in `gradient = np.empty((3, PIECE), weight.dtype)`",
            "fitting.deformation_step.deformation_adam_step: `3` -> `4` in `rate = np.empty((3, CHANNELS))`",
            "losses.similarity._similarity: `4` -> `5` in `columns = np.empty((4, width + 2 * RADIUS), "
            "difference.dtype)`",
            "losses.similarity._similarity_reverse: `3` -> `4` in `smooth = np.empty((3, width), d_rendered.dtype)`",
            "losses.similarity._similarity: `5` -> `6` in `lines = np.empty((5, width), difference.dtype)`",
            "equations.laplacian._expand_adjoint: `2` -> `3` in `pairs = np.zeros((m + 2, 2), out.dtype)`",
            "equations.laplacian._reduce_adjoint: `4` -> `5` in `gathered = np.zeros(m + 4, out.dtype)`",
            "splatting.projection._project_reverse: `2` -> `3` in `jw, d_jw = (np.empty((2, 3), position.dtype), "
            "np.empty((2, 3), position.dtype))`",
            "splatting.projection._project_reverse: `3` -> `4` in `jw, d_jw = (np.empty((2, 3), position.dtype), "
            "np.empty((2, 3), position.dtype))`",
            "splatting.projection._project_reverse: `2` -> `3` in `jw, d_jw = (np.empty((2, 3), position.dtype), "
            "np.empty((2, 3), position.dtype))` (2)",
            "splatting.projection._project_reverse: `3` -> `4` in `jw, d_jw = (np.empty((2, 3), position.dtype), "
            "np.empty((2, 3), position.dtype))` (2)",
            "splatting.projection._project_reverse: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), "
            "np.empty(3, position.dtype), np.empty(3, position.dtype))`",
            "splatting.projection._project_reverse: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), "
            "np.empty(3, position.dtype), np.empty(3, position.dtype))` (2)",
            "splatting.projection._project_reverse: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), "
            "np.empty(3, position.dtype), np.empty(3, position.dtype))` (3)",
            "splatting.projection._project_reverse: `3` -> `4` in `small = np.empty(3, position.dtype)`",
            "splatting.projection._project: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), np.empty(3, "
            "position.dtype), np.empty(3, position.dtype))`",
            "splatting.projection._project: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), np.empty(3, "
            "position.dtype), np.empty(3, position.dtype))` (2)",
            "splatting.projection._project: `3` -> `4` in `t0, t1, s = (np.empty(3, position.dtype), np.empty(3, "
            "position.dtype), np.empty(3, position.dtype))` (3)",
            "splatting.projection.projection_reverse_footprint: `4` -> `5` in `d_poses = np.zeros(((n + BLOCK - "
            "1) // BLOCK, 3 if pose_gradient else 0, 4), dtype)`",
            "equations.laplacian._band_signs: `2` -> `3` in `blend = np.empty(m + 2, fine.dtype)`",
            "splatting.compositing_rows._blend_reverse: `6` -> `7` in `buffer = np.zeros(6 * PLANE, records.dtype)`",
            "splatting.compositing_rows._blend: `5` -> `6` in `buffer = np.zeros(5 * PLANE, records.dtype)`",
            "splatting.compositing_rows._blend: `5` -> `6` in `lines = np.empty(5 * TILE_HEIGHT, records.dtype)`",
            "splatting.compositing_rows._blend_reverse: `5` -> `6` in `lines = np.empty(5 * TILE_HEIGHT, "
            "records.dtype)`",
            "splatting.compositing._composite_reverse: `5` -> `6` in `kept = np.empty((length, 5), records.dtype)`",
            "splatting.binning.tile_lists: `4` -> `5` in `tile_box = np.empty((n, 4), np.int32)`",
        ),
    ),
    Group(
        "Every cell is written again before it is read, or all cells are cleared in another order.",
        (
            "losses.similarity._clear_border: `-RADIUS` -> `RADIUS` in `for border in (slice(None, RADIUS), "
            "slice(-RADIUS, None))`",
            "equations.pyramid._gather_rows: `x` -> `x - 1` in `target[x] = real(0.0)`",
            "equations.deformation._forward: `i` -> `i - 1` in `out[i] = weight.dtype.type(0)`",
            "equations.matern._row_square_sums: `k` -> `k - 1` in `lanes[k] = 0.0`",
            "equations.matern._row_square_sums: `k` -> `k - 1` in `total += lanes[k]`",
            "equations.atom_sums.spread: `np.zeros((tasks, coefficients.shape[1]))` -> `np.ones((tasks, "
            "coefficients.shape[1]))` in `partial = np.zeros((tasks, coefficients.shape[1]))`",
            "equations.atom_sums._spread: `min(n, start + BLOCK)` -> `max(n, start + BLOCK)` in `stop = min(n, "
            "start + BLOCK)`",
            "splatting.projection.projection_reverse: `np.zeros_like(d_covariance2d)` -> "
            "`np.ones_like(d_covariance2d)` in `d_footprint = np.zeros_like(d_covariance2d)`",
            "splatting.binning.screen_boxes: `np.zeros((projected.depth.size, 4), np.int32)` -> "
            "`np.ones((projected.depth.size, 4), np.int32)` in `box = np.zeros((projected.depth.size, 4), "
            "np.int32)`",
            "losses.smoothness._squared_steps: `np.zeros(width, depth.dtype)` -> `np.ones(width, depth.dtype)` in "
            "`steps = np.zeros(width, depth.dtype)`",
            "equations.atom_sums._combine: `k` -> `k - 1` in `total[k] = zero`",
            "splatting.records._gather: `j` -> `j - 1` in `total[j] = zero`",
            "equations.atom_sums._atom_totals: `k` -> `k - 1` in `lanes[k] = 0.0`",
            "equations.laplacian._band_signs: `x` -> `x - 1` in `columns[x] = 0.0`",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_position[k, i] = d_scale[k, i] = zero`",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_position[k, i] = d_scale[k, i] = zero` (2)",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_rotation[k, 0, i] = d_rotation[k, 1, i] "
            "= d_rotation[k, 2, i] = zero`",
            "splatting.compositing_rows._blend_reverse: `np.zeros(GRADIENT * LANES, records.dtype)` -> "
            "`np.ones(GRADIENT * LANES, records.dtype)` in `sums = np.zeros(GRADIENT * LANES, records.dtype)`",
            "equations.laplacian._expand_adjoint: `x` -> `x - 1` in `target[x] *= scale`",
            "equations.laplacian._difference: `0.0` -> `1.0` in `target[x] = d if keep[x] else real(0.0)`",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `gx[i] = gy[i] = gz[i] = zero` (3)",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_rotation[k, 0, i] = d_rotation[k, 1, i] "
            "= d_rotation[k, 2, i] = zero` (2)",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_rotation[k, 0, i] = d_rotation[k, 1, i] "
            "= d_rotation[k, 2, i] = zero` (3)",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_jw[0, k] = d_jw[1, k] = zero`",
            "splatting.projection._project_reverse: `k` -> `k - 1` in `d_jw[0, k] = d_jw[1, k] = zero` (2)",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `gx[i] = gy[i] = gz[i] = zero`",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `gx[i] = gy[i] = gz[i] = zero` (2)",
            "equations.laplacian._reduce_adjoint: `x` -> `x - 1` in `target[x] = real(0.0)`",
            "splatting.compositing_rows._blend_reverse: `j` -> `j - 1` in `out[j] = zero`",
            "splatting.harmonics._colour_reverse_block: `i` -> `i - 1` in `out[i] = zero`",
        ),
    ),
    Group(
        "What stands in for a number that is not used: a dead atom has gain 0, a zero quaternion is replaced.",
        (
            "equations.fourier.report_atoms: `1.0` -> `0.5` in `gain = np.where(statistics.dead, 0.0, 1.0 / "
            "np.where(statistics.dead, 1.0, statistics.rms))` (2)",
            "equations.fourier.normalise_forward: `1.0` -> `0.5` in `gain = np.where(statistics.dead, 0.0, 1.0 / "
            "np.where(statistics.dead, 1.0, statistics.rms))` (2)",
            "scene.density_control._rotations: `largest > 0.0` -> `largest >= 0.0` in `q = np.where(largest > "
            "0.0, quaternion / np.where(largest > 0.0, largest, 1.0), [[1.0], [0.0], [0.0], [0.0]])` (2)",
            "equations.fourier.report_atoms: `1.0` -> `0.5` in `gain = np.where(statistics.dead, 0.0, 1.0 / "
            "np.where(statistics.dead, 1.0, statistics.rms))`",
            "scene.density_control._rotations: `1.0` -> `0.5` in `q = np.where(largest > 0.0, quaternion / "
            "np.where(largest > 0.0, largest, 1.0), [[1.0], [0.0], [0.0], [0.0]])`",
            "scene.density_control._rotations: `1.0` -> `0.5` in `q = np.where(largest > 0.0, quaternion / "
            "np.where(largest > 0.0, largest, 1.0), [[1.0], [0.0], [0.0], [0.0]])` (2)",
        ),
    ),
    Group(
        "The logarithm of 0 or less is minus infinity or not a number, and nothing is below it; the statement "
        "saves the warning.",
        (
            "scene.density_control._fainter_than: `if opacity <= 0.0` dropped",
            "scene.density_control._fainter_than: `opacity <= 0.0` -> `opacity < 0.0` in `if opacity <= 0.0`",
        ),
    ),
    Group(
        "The end of a tile in which every pixel is finished is missed: more work, the same picture.",
        (
            "splatting.compositing_rows._finished: `0` -> `1` in `alive = np.int32(0)`",
            "splatting.compositing_rows._finished: `alive += np.int32(buffer[_U64(j)] > zero)` -> `alive -= "
            "np.int32(buffer[_U64(j)] > zero)` in `alive += np.int32(buffer[_U64(j)] > zero)`",
            "splatting.compositing_rows._finished: `buffer[_U64(j)] > zero` -> `buffer[_U64(j)] >= zero` in "
            "`alive += np.int32(buffer[_U64(j)] > zero)`",
            "splatting.compositing_rows._blend_reverse: `if done` dropped",
            "splatting.compositing_rows._blend: `break` dropped",
        ),
    ),
    Group(
        "A box, row or span is wider than it has to be, or a margin is still wider than the roundings of any "
        "input we tried.",
        (
            "splatting.binning._boxes: `ex + abs(x)` -> `abs(x)` in `ex += (ex + abs(x)) * real(1e-05) + margin`",
            "splatting.binning._boxes: `0` -> `1` in `box[i, 0], box[i, 1], box[i, 2], box[i, 3] = (0, width - 1, "
            "0, height - 1)` (2)",
            "splatting.compositing_rows._spans: `u - half` -> `u` in `offset = u - half - real(left)`",
            "splatting.compositing_rows._spans: `one - log2_cutoff` -> `one` in `faintest = log2_cutoff - (one - "
            "log2_cutoff) * real(1e-06)`",
            "splatting.binning._boxes: `0.001` -> `0.0005` in `margin, right, bottom = (real(0.001), real(width - "
            "1), real(height - 1))`",
            "splatting.compositing_rows._rows: `(reach + abs(record[V])) * real(1e-05) + real(0.001)` -> `(reach "
            "+ abs(record[V])) * real(1e-05)` in `reach += (reach + abs(record[V])) * real(1e-05) + real(0.001)`",
            "splatting.compositing_rows._rows: `reach + abs(record[V])` -> `reach` in `reach += (reach + "
            "abs(record[V])) * real(1e-05) + real(0.001)`",
            "splatting.compositing_rows._rows: `reach + abs(record[V])` -> `abs(record[V])` in `reach += (reach + "
            "abs(record[V])) * real(1e-05) + real(0.001)`",
            "splatting.compositing_rows._rows: `V` -> `V - 1` in `reach += (reach + abs(record[V])) * real(1e-05) "
            "+ real(0.001)`",
            "splatting.compositing_rows._rows: `1e-05` -> `5e-06` in `reach += (reach + abs(record[V])) * "
            "real(1e-05) + real(0.001)`",
            "splatting.compositing_rows._rows: `0.001` -> `0.0005` in `reach += (reach + abs(record[V])) * "
            "real(1e-05) + real(0.001)`",
            "splatting.compositing_rows._spans: `abs(u) * real(1e-05) + real(0.001)` -> `abs(u) * real(1e-05)` in "
            "`spread, margin = (one / (half * real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-05) + "
            "real(0.001))`",
            "splatting.compositing_rows._spans: `abs(u) * real(1e-05) + real(0.001)` -> `real(0.001)` in `spread, "
            "margin = (one / (half * real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-05) + real(0.001))`",
            "splatting.compositing_rows._spans: `1e-05` -> `5e-06` in `spread, margin = (one / (half * "
            "real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-05) + real(0.001))`",
            "splatting.compositing_rows._spans: `0.001` -> `0.0005` in `spread, margin = (one / (half * "
            "real(LOG2_E) * record[PRECISION]), abs(u) * real(1e-05) + real(0.001))`",
            "splatting.compositing_rows._spans: `one - log2_cutoff` -> `-log2_cutoff` in `faintest = log2_cutoff "
            "- (one - log2_cutoff) * real(1e-06)`",
            "splatting.compositing_rows._spans: `1e-06` -> `5e-07` in `faintest = log2_cutoff - (one - "
            "log2_cutoff) * real(1e-06)`",
            "splatting.compositing_rows._rows: `record[V] + reach - half` -> `record[V] + reach` in `high = "
            "min(record[V] + reach - half - real(top), real(TILE_HEIGHT - 1))`",
            "splatting.compositing_rows._rows: `high >= zero` -> `high > zero` in `return (first, np.int32(high) "
            "if high >= zero else np.int32(-1))`",
            "splatting.compositing_rows._rows: `-1` -> `1` in `return (first, np.int32(high) if high >= zero else "
            "np.int32(-1))`",
            "splatting.compositing_rows._rows: `1` -> `2` in `return (first, np.int32(high) if high >= zero else "
            "np.int32(-1))`",
            "splatting.compositing_rows._spans: `math.sqrt(max(spread * (exponent - faintest), zero)) + margin` "
            "-> `math.sqrt(max(spread * (exponent - faintest), zero))` in `width = math.sqrt(max(spread * "
            "(exponent - faintest), zero)) + margin`",
            "splatting.compositing_rows._spans: `high >= zero` -> `high > zero` in `lines[k + _U64(4 * "
            "TILE_HEIGHT)] = high if high >= zero else -one`",
            "splatting.compositing_rows._blend: `1` -> `2` in `for x in range(low, high + 1, LANES)`",
            "splatting.compositing_rows._blend_reverse: `1` -> `2` in `for x in range(low, high + 1, LANES)`",
            "splatting.binning._boxes: `1e-05` -> `5e-06` in `ex += (ex + abs(x)) * real(1e-05) + margin`",
            "splatting.binning._boxes: `1e-05` -> `5e-06` in `ey += (ey + abs(y)) * real(1e-05) + margin`",
        ),
    ),
    Group(
        "The taps of the filter are the same from either side, and `zip` ends with the shorter sequence.",
        (
            "equations.pyramid.reduce_adjoint_table: `1` -> `2` in `for offset, tap in zip(range(-MARGIN, MARGIN "
            "+ 1), BINOMIAL)`",
            "equations.pyramid.reduce_adjoint_table: `2 * k + offset` -> `2 * k - offset` in `key = (_reflect(2 * "
            "k + offset, n), k)`",
            "equations.pyramid.reflect_indices: `2 * k + o` -> `2 * k - o` in `return [np.array([_reflect(2 * k + "
            "o, n) for k in range(coarse_length(n))], np.int64) for o in taps]`",
        ),
    ),
    Group(
        "Whole turns are taken off once more with the quarter turns; taking them off before keeps the integer small.",
        ("equations.fourier._sine_cosine: `phase - np.rint(phase)` -> `phase` in `turn = phase - np.rint(phase)`",),
    ),
    Group(
        "A factor common to all frequencies cancels in the normalisation to mean 1.",
        (
            "equations.matern.matern_weights: `1.0 + small` -> `1.0` in `density = ((small + ratio ** 2) / (1.0 + "
            "small)) ** 3`",
            "equations.matern.matern_weights: `5.0 + scaled ** 2` -> `5.0` in `density = ((5.0 + (scaled * ratio) "
            "** 2) / (5.0 + scaled ** 2)) ** 3`",
            "equations.matern.matern_weights: `2` -> `3` in `density = ((5.0 + (scaled * ratio) ** 2) / (5.0 + "
            "scaled ** 2)) ** 3` (2)",
            "equations.matern.matern_weights: `(5.0 + (scaled * ratio) ** 2) / (5.0 + scaled ** 2)` -> `(5.0 + "
            "(scaled * ratio) ** 2) * (5.0 + scaled ** 2)` in `density = ((5.0 + (scaled * ratio) ** 2) / (5.0 + "
            "scaled ** 2)) ** 3`",
            "equations.matern.matern_weights: `5.0 + scaled ** 2` -> `5.0 - scaled ** 2` in `density = ((5.0 + "
            "(scaled * ratio) ** 2) / (5.0 + scaled ** 2)) ** 3`",
            "equations.matern.matern_weights: `scaled ** 2` -> `scaled * 2` in `density = ((5.0 + (scaled * "
            "ratio) ** 2) / (5.0 + scaled ** 2)) ** 3`",
            "equations.matern.matern_weights: `5.0` -> `2.5` in `density = ((5.0 + (scaled * ratio) ** 2) / (5.0 "
            "+ scaled ** 2)) ** 3` (2)",
        ),
    ),
    Group(
        "The four partial sums of a fold are added in another order.",
        (
            "splatting.compositing_rows._fold_lanes: `base + _U64(lane)` -> `base` in `sums[base + _U64(lane)] += "
            "sums[base + _U64(lane + LANES // 4)]`",
            "splatting.compositing_rows._fold_lanes: `base + _U64(lane)` -> `base` in `sums[base + _U64(lane)] += "
            "sums[base + _U64(lane + LANES // 2)]`",
        ),
    ),
    Group(
        "A gradient that nobody asks for is formed as well.",
        (
            "fitting.model.scene_reverse: `False` -> `True` in `appearance = appearance_reverse(grads.residual, "
            "saved.appearance, atom_gradient=False)`",
            "fitting.model.scene_reverse: `False` -> `True` in `motion = motion_reverse(grads.position, "
            "saved.motion, atom_gradient=False)`",
        ),
    ),
    Group(
        "The index -1 is the last cell as well.",
        (
            "splatting.binning._tile_starts: `starts.size - 1` -> `-1` in `starts[starts.size - 1] = total`",
            "losses.smoothness._variation: `width - 1` -> `-1` in `steps[width - 1] = image.dtype.type(0)`",
            "losses.smoothness._squared_steps: `width - 1` -> `-1` in `steps[width - 1] = zero`",
            "equations.pyramid._expand_row_adjoint: `m - 1` -> `-1` in `out[m - 1] += odd_rest * own[m - 1, 1]`",
        ),
    ),
    Group(
        "A weight of 0 stands before it.",
        (
            "equations.deformation._reverse_row: `0` -> `1` in `ratio = real(0) if exponent < cut else ratio`",
            "splatting.harmonics._basis_gradient: `degree > 1` -> `degree >= 1` in `for k in range(gx.size if "
            "degree > 1 else 0)`",
            "splatting.harmonics._basis_gradient: `0` -> `1` in `for k in range(gx.size if degree > 1 else 0)`",
            "splatting.harmonics._basis_gradient: `degree > 2` -> `degree >= 2` in `for k in range(gx.size if "
            "degree > 2 else 0)`",
            "splatting.harmonics._basis_gradient: `0` -> `1` in `for k in range(gx.size if degree > 2 else 0)`",
        ),
    ),
    Group(
        "Without a cutoff its logarithm is not used.",
        (
            "splatting.render.render_forward: `0.0` -> `1.0` in `log_cutoff = math.log(settings.alpha_cutoff) if "
            "settings.alpha_cutoff > 0 else 0.0`",
            "splatting.binning.screen_boxes: `0.0` -> `1.0` in `log_cutoff = "
            "projected.depth.dtype.type(math.log(settings.alpha_cutoff) if settings.alpha_cutoff > 0 else 0.0)`",
        ),
    ),
    Group(
        "All cells of a sum are shifted in a circle: the same sum in another order.",
        (
            "splatting.harmonics._colour_reverse_blocks: `block` -> `block - 1` in "
            "`_colour_reverse_kernel(harmonics, position, centre, degree, clamped, d_colour, d_harmonics, d_base, "
            "d_position, d_centres[block], a, e)`",
            "losses.depth._residual: `i` -> `i - 1` in `signed[i] = with_sign if use[i] else zero`",
            "equations.atom_sums._atom_totals: `k` -> `k - 1` in `rest += lanes[k]`",
            "splatting.binning._radix_order: `i` -> `i - 1` in `if visible[i]`",
            "losses.photometric._absolute_difference: `i` -> `i - 1` in `line[i] = abs(seen[i] - wanted[i]) if "
            "tissue[i] else zero`",
            "losses.photometric._absolute_difference: `index` -> `index - 1` in `totals[index] = row_total(line)`",
            "equations.matern._row_square_sums: `k` -> `k - 1` in `lanes[k] += v * v`",
            "equations.atom_sums._atom_totals: `k` -> `k - 1` in `lanes[k] += np.float64(x[k]) * np.float64(y[k])`",
            "losses.depth._residual: `i` -> `i - 1` in `size[i] = abs(residual) if use[i] else zero`",
            "equations.deformation._reverse: `i` -> `i - 1` in `total += np.float64(d_m[i])`",
            "equations.deformation._reverse: `c` -> `c - 1` in `row_sums[c, j] = total`",
            "equations.deformation._reverse: `j` -> `j - 1` in `row_sums[c, j] = total`",
            "splatting.binning._radix_order: `i` -> `i - 1` in `histogram[np.int64(np.uint64(keys[i]) >> "
            "np.uint64(shift) & mask)] += 1`",
            "equations.atom_sums._atom_totals: `block` -> `block - 1` in `partial[block, a] = rest`",
            "equations.laplacian._band_signs: `x` -> `x - 1` in `columns[x] += np.float64(abs(band))`",
            "equations.laplacian._band_signs: `x` -> `x - 1` in `total += columns[x]`",
            "equations.laplacian._band_signs: `task` -> `task - 1` in `sums[task] = total`",
            "losses.smoothness._variation: `i` -> `i - 1` in `steps[i] += abs(other[i] - line[i])`",
            "losses.smoothness._squared_steps: `i` -> `i - 1` in `steps[i] += squared if use[i] & use_below[i] "
            "else zero`",
            "losses.smoothness._variation: `index` -> `index - 1` in `totals[index] = row_total(steps)`",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `sum_x += gx[i]`",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `sum_y += gy[i]`",
            "splatting.harmonics._direction_to_position_block: `i` -> `i - 1` in `sum_z += gz[i]`",
            "losses.similarity._similarity: `i` -> `i - 1` in `dissimilarity[i] = p_loss + p * q_loss if "
            "tissue[i] else zero`",
            "losses.similarity._similarity: `index` -> `index - 1` in `totals[index] = row_total(dissimilarity)`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(LANES)` -> `_U64(LANES)` in `sums[k + "
            "_U64(LANES)] += se`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(2 * LANES)` -> `_U64(2 * LANES)` in `sums[k "
            "+ _U64(2 * LANES)] += sy`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(3 * LANES)` -> `_U64(3 * LANES)` in `sums[k "
            "+ _U64(3 * LANES)] += se * e`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(4 * LANES)` -> `_U64(4 * LANES)` in `sums[k "
            "+ _U64(4 * LANES)] += se * dy`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(5 * LANES)` -> `_U64(5 * LANES)` in `sums[k "
            "+ _U64(5 * LANES)] += sy * dy`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(6 * LANES)` -> `_U64(6 * LANES)` in `sums[k "
            "+ _U64(6 * LANES)] += weight * g0`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(7 * LANES)` -> `_U64(7 * LANES)` in `sums[k "
            "+ _U64(7 * LANES)] += weight * g1`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(8 * LANES)` -> `_U64(8 * LANES)` in `sums[k "
            "+ _U64(8 * LANES)] += weight * g2`",
            "splatting.compositing_rows._blend_row_reverse: `k + _U64(9 * LANES)` -> `_U64(9 * LANES)` in `sums[k "
            "+ _U64(9 * LANES)] += weight * gz`",
        ),
    ),
    Group(
        "Both forms are accurate to rounding on either side of the switch.",
        (
            "equations.appearance._tanh_and_slope: `0.5` -> `0.25` in `value = small if size < real(0.5) else large`",
            "equations.matern.matern_weights: `math.sqrt(5.0)` -> `5.0` in `if scaled >= math.sqrt(5.0)`",
            "equations.matern.matern_weights: `5.0` -> `2.5` in `if scaled >= math.sqrt(5.0)`",
            "equations.appearance._tanh_and_slope: `size < real(0.5)` -> `size <= real(0.5)` in `value = small if "
            "size < real(0.5) else large`",
        ),
    ),
    Group(
        "So far out the basis value is below 2^-60, and 0 in its place changes nothing.",
        (
            "equations.deformation._add_row: `exponent < cut` -> `exponent <= cut` in `out[i] += weight[i] * "
            "(real(0) if exponent < cut else value)`",
            "equations.deformation._basis_constants: `2` -> `3` in `return (real(-0.5 * LOG2_E), real(0), "
            "real(1), real(2 * LARGEST_U), real(1))`",
            "equations.deformation._reverse_row: `exponent < cut` -> `exponent <= cut` in `value = (real(0) if "
            "exponent < cut else value) * d_offset[i]`",
            "equations.deformation._reverse_row: `exponent < cut` -> `exponent <= cut` in `ratio = real(0) if "
            "exponent < cut else ratio`",
        ),
    ),
    Group(
        "No rounding of a root mean square falls on the bound exactly.",
        (
            "equations.fourier.atom_statistics: `rms < DEAD_RMS` -> `rms <= DEAD_RMS` in `return "
            "AtomStatistics(mean, rms, rms < DEAD_RMS)`",
        ),
    ),
    Group(
        "The loss is off, and its reverse pass reads nothing else.",
        (
            "losses.depth.normalised_depth_forward: `0.0` -> `1.0` in `return (0.0, DepthSaved(rendered_depth, "
            "target, 0.0, 0.0))` (3)",
        ),
    ),
    Group(
        "Both sequences have one entry a call; `strict` is a guard.",
        ("fitting.objective.image_loss: `True` -> `False` in `for name, term in zip(calls, others, strict=True)`",),
    ),
    Group(
        "No number is in an empty array.",
        (
            "equations.calibration.calibration_views: `np.zeros(0, np.int64)` -> `np.ones(0, np.int64)` in "
            "`return np.zeros(0, np.int64)`",
            "fitting.objective.photometric_loss: `np.zeros((0, 0), colour.dtype)` -> `np.ones((0, 0), "
            "colour.dtype)` in `return ImageLoss(loss, terms, d_colour, np.zeros((0, 0), colour.dtype))`",
            "fitting.objective.photometric_loss: `0` -> `1` in `return ImageLoss(loss, terms, d_colour, "
            "np.zeros((0, 0), colour.dtype))`",
            "fitting.objective.photometric_loss: `0` -> `1` in `return ImageLoss(loss, terms, d_colour, "
            "np.zeros((0, 0), colour.dtype))` (2)",
        ),
    ),
    Group(
        "A slice ends where its array ends.",
        (
            "equations.atom_sums._combine: `min(n, start + BLOCK)` -> `max(n, start + BLOCK)` in `stop = min(n, "
            "start + BLOCK)`",
            "equations.deformation._forward: `min(count, start + PIECE)` -> `max(count, start + PIECE)` in `stop "
            "= min(count, start + PIECE)`",
        ),
    ),
    Group(
        "A variance may be taken about any value: the centre of the window only keeps the rounding small, and so "
        "does a neighbour.",
        (
            "losses.similarity._column_moments: `RADIUS` -> `RADIUS - 1` in `centre = rows[RADIUS, i]`",
            "losses.similarity._row_moments: `i + RADIUS` -> `i` in `centre = column_mean[i + RADIUS]`",
        ),
    ),
    Group(
        "Far beyond the largest finite exponent, and far from where the sum changes.",
        (
            "splatting.records._gather: `700` -> `701` in `half, one, zero, largest = (real(0.5), real(1), "
            "real(0), real(700))`",
        ),
    ),
    Group(
        "Not a number makes the result not a number either way.",
        (
            "splatting.covariance._unit_quaternion: `zero + type(zero)(1)` -> `type(zero)(1)` in `one = zero + "
            "type(zero)(1)`",
        ),
    ),
    Group(
        "What is not visible stays so, and its box is not read.",
        (
            "splatting.binning._boxes: `if not visible[i]` dropped",
            "splatting.binning._boxes: `continue` dropped",
            "splatting.binning._boxes: `continue` dropped (4)",
        ),
    ),
    Group(
        "A negative index is mirrored by the remainder as well.",
        (
            "equations.pyramid._reflect: `abs(i)` -> `i` in `i = abs(i) % period`",
            "equations.pyramid._reduce_row_adjoint: `-2` -> `2` in `inside[reflect(-2, w)] += padded[0]`",
            "equations.pyramid._reduce_row_adjoint: `-1` -> `1` in `inside[reflect(-1, w)] += padded[1]`",
            "equations.pyramid._reduce_row: `-2` -> `2` in `padded[0] = inside[reflect(-2, w)]`",
            "equations.pyramid._reduce_row: `-1` -> `1` in `padded[1] = inside[reflect(-1, w)]`",
        ),
    ),
    Group(
        "A value that is chosen only where the argument is smaller.",
        ("equations.appearance._tanh_and_slope: `1.0` -> `0.5` in `q = min(x * x, real(1.0))`",),
    ),
    Group(
        "Overwritten by its last reader.",
        (
            "losses.similarity._similarity: `4` -> `3` in `mean_e, variance_e, mean_s, variance_s, dissimilarity "
            "= (lines[0], lines[1], lines[2], lines[3], lines[4])`",
        ),
    ),
    Group(
        "One more pass sorts by digits that are all zero.",
        ("splatting.binning._radix_order: `8` -> `9` in `for shift in range(0, 8 * key.itemsize, _RADIX_BITS)`",),
    ),
    Group(
        "Directions are formed although no band of degree 0 reads them.",
        (
            "splatting.harmonics._colour_block: `degree > 0` -> `degree >= 0` in `if degree > 0`",
            "splatting.harmonics._colour_reverse_block: `degree > 0` -> `degree >= 0` in `if degree > 0`",
        ),
    ),
    Group(
        "Basis functions of a band above the degree are formed, and nothing reads them.",
        (
            "splatting.harmonics._basis: `degree > 1` -> `degree >= 1` in `for k in range(count if degree > 1 else 0)`",
            "splatting.harmonics._basis: `0` -> `1` in `for k in range(count if degree > 1 else 0)`",
            "splatting.harmonics._basis: `degree > 2` -> `degree >= 2` in `for k in range(count if degree > 2 else 0)`",
            "splatting.harmonics._basis: `0` -> `1` in `for k in range(count if degree > 2 else 0)`",
        ),
    ),
    Group(
        "There are three rows or none.",
        ("splatting.projection._project_reverse: `0` -> `1` in `if d_poses.shape[1] > 0`",),
    ),
    Group(
        "What is left out only saves time: finished pixels take nothing, and of a band above the degree the basis "
        "functions are 0.",
        (
            "splatting.compositing_rows._blend: `if _finished_kernel(buffer)` dropped",
            "splatting.compositing_rows._blend_reverse: `continue` dropped",
            "splatting.harmonics._colour_reverse_block: `if k >= bands` dropped",
            "splatting.harmonics._colour_reverse_block: `k >= bands` -> `k > bands` in `if k >= bands`",
        ),
    ),
    Group(
        "The same neighbours, or the same pairs of axes.",
        (
            "losses.smoothness._squared_steps_reverse: `2` -> `3` in `for neighbour in range(y - 1, y + 2, 2)`",
            "splatting.projection._project: `k + 1` -> `k - 1` in `n = (k + 1) % 3`",
            "splatting.projection._project: `1` -> `2` in `n = (k + 1) % 3`",
        ),
    ),
    Group(
        "Far beyond the picture either way.",
        (
            "splatting.binning._boxes: `right + tile` -> `right` in `limit_x, limit_y = (right + tile, bottom + tile)`",
            "splatting.binning._boxes: `bottom + tile` -> `bottom` in `limit_x, limit_y = (right + tile, bottom + "
            "tile)`",
        ),
    ),
    Group(
        "Infinite with either sign.",
        (
            "splatting.projection._project: `det + z` -> `det - z` in `if not (abs(mean_x) <= axis_limit and "
            "abs(mean_y) <= axis_limit and math.isfinite(det + z))`",
        ),
    ),
    Group(
        "The cell holds 0 from the start.",
        (
            "splatting.binning._boxes: `i` -> `i - 1` in `box[i, 0], box[i, 1], box[i, 2], box[i, 3] = (0, width "
            "- 1, 0, height - 1)`",
            "splatting.binning._boxes: `i` -> `i - 1` in `box[i, 0], box[i, 1], box[i, 2], box[i, 3] = (0, width "
            "- 1, 0, height - 1)` (3)",
            "splatting.binning._boxes: `0` -> `1` in `box[i, 0], box[i, 1], box[i, 2], box[i, 3] = (0, width - 1, "
            "0, height - 1)`",
        ),
    ),
    Group(
        "Both lengths of the array are 0, or neither is.",
        ("splatting.compositing_rows._read_tile: `0` -> `1` in `if d_opacity.shape[0] > 0`",),
    ),
)


def reasons() -> dict[str, str]:
    """The reason by the name of the mutant."""
    return {name: group.reason for group in EQUIVALENT for name in group.names}
