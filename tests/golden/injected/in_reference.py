"""Single mistakes for the reference, in the families that the port in C99 leaves out, and in training.

None is the edit of the wrong port of its name: the same mistake is made at another place or in another way, and the
port that makes it computes in float32, with the fast compositor.
"""

import in_images
from in_images import mistake

ADAM, SCHEDULES, CONTROL = "fitting.adam", "fitting.schedules", "scene.density_control"
FIRST, MODEL, RENDER, OBJECTIVE = "scene.initialisation", "fitting.model", "splatting.render", "fitting.objective"
VIEW, TRAINER, STAGE = "fitting.view", "fitting.trainer", "stages.optimiser"


TRAINING = [
    mistake(
        "adam_without_bias_correction",
        "adam",
        (
            ADAM,
            "    rate, root = step_factors(step, learning_rate, beta1, beta2)\n    p, g",
            "    rate, root = learning_rate, 1.0\n    p, g",
        ),
    ),
    mistake(
        "adam_epsilon_1e-8",
        "adam",
        (ADAM, "float(beta1), float(beta2), float(epsilon))", "float(beta1), float(beta2), 1e-8)"),
    ),
    mistake(
        "adam_second_moment_uncorrected", "adam", (ADAM, "(np.sqrt(v) * root + epsilon)", "(np.sqrt(v) + epsilon)")
    ),
    mistake(
        "degree_late",
        "schedule training",
        (
            SCHEDULES,
            "return min(config.model.harmonics_degree, iteration //",
            "iteration -= 1\n    return min(config.model.harmonics_degree, iteration //",
        ),
    ),
    mistake(
        "laplacian_ramp_late",
        "schedule training",
        (
            SCHEDULES,
            "    if iteration >= config.loss.laplacian_full:\n        return 1.0\n",
            "    iteration -= 1\n    if iteration >= config.loss.laplacian_full - 1:\n        return 1.0\n",
        ),
    ),
    mistake(
        "laplacian_weight_not_ramped",
        "schedule training",
        (
            SCHEDULES,
            "iteration <= config.loss.laplacian_from:\n        return 0.0",
            "iteration < 0:\n        return 0.0",
        ),
        (SCHEDULES, "if iteration >= config.loss.laplacian_full:", "if iteration >= 0:"),
    ),
    mistake(
        "residuals_activated_late",
        "schedule training",
        (SCHEDULES, "return has_any and iteration > config", "return has_any and iteration - 1 > config"),
    ),
    mistake(
        "rates_not_decaying",
        "schedule training",
        (SCHEDULES, "fraction = min(max(step / steps, 0.0), 1.0) if steps > 0 else 1.0", "fraction = 0.0"),
    ),
    mistake(
        "statistics_from_start",
        "schedule training",
        (
            SCHEDULES,
            "return iteration < config.density.until",
            "return iteration in range(config.density.start + 1, config.density.until)",
        ),
    ),
    mistake(
        "densify_from_start",
        "schedule",
        (SCHEDULES, "return density.start < iteration <", "return density.start - 1 < iteration <"),
    ),
    mistake(
        "screen_gradient_without_half",
        "density training",
        (CONTROL, "np.float64(0.5 * width)", "np.float64(width)"),
        (CONTROL, "np.float64(0.5 * height)", "np.float64(height)"),
    ),
    mistake(
        "densify_threshold_in_pixels",
        "density training",
        (CONTROL, "np.float64(0.5 * width)", "1.0"),
        (CONTROL, "np.float64(0.5 * height)", "1.0"),
    ),
    mistake(
        "density_over_all_views",
        "density training",
        (CONTROL, "statistics.visits[:] += visible", "statistics.visits[:] += np.ones_like(visible)"),
    ),
    mistake(
        "clone_and_split_swapped",
        "density training",
        (
            CONTROL,
            "largest[candidates] <= config.dense_fraction * extent",
            "largest[candidates] > config.dense_fraction * extent",
        ),
    ),
    mistake("children_not_smaller", "density training", (CONTROL, "SHRINK = 0.8 * CHILDREN", "SHRINK = 1.0")),
    mistake(
        "children_not_turned",
        "density training",
        (
            CONTROL,
            "rotation = _rotations(parents.quaternion[:, split].astype(np.float64))",
            "rotation = np.eye(3)[:, :, None]",
        ),
    ),
    mistake(
        "split_parent_kept",
        "density training",
        (CONTROL, "    keep[split] = False\n", "    keep[split] = alive[split]\n"),
    ),
    mistake("extent_without_margin", "density", (CONTROL, "return CAMERA_MARGIN * radius", "return radius")),
    mistake(
        "prune_at_the_threshold",
        "density",
        (
            CONTROL,
            "alive = ~_fainter_than(gaussians.opacity_logit, config.prune_opacity)",
            "alive = _fainter_than(-gaussians.opacity_logit, 1 - config.prune_opacity)",
        ),
    ),
    mistake("initial_colour_without_y00", "initialisation", (FIRST, "(colour - 0.5) / Y00", "(colour - 0.5) / 1.0")),
    mistake(
        "mean_distance_for_scale",
        "initialisation",
        (FIRST, "half_log = 0.5 * np.log(", "half_log = np.log("),
        (FIRST, "return (distance**2).mean(axis=1)", "return distance.mean(axis=1)"),
    ),
    mistake(
        "backprojected_at_corner",
        "initialisation",
        (FIRST, "column.astype(np.float64), row.astype(np.float64)", "column - 0.5, row - 0.5"),
    ),
    mistake("moved_pixels_ignored", "initialisation", (FIRST, "> config.motion_threshold", "> 1e9")),
    mistake(
        "holes_initialised",
        "initialisation",
        (
            FIRST,
            "sequence.masks[k] & (depth > 0) & np.isfinite(depth)",
            "sequence.masks[k] & np.isfinite(np.maximum(depth, depth[depth > 0].min(), out=depth))",
        ),
    ),
    mistake(
        "children_inherit_moments",
        "training",
        (
            ADAM.replace("fitting.adam", "fitting.trainer"),
            "    regather(state.adam, arrays(result.gaussians), result.plan.source, result.plan.survivors)",
            "    regather(state.adam, arrays(result.gaussians), result.plan.source, len(result.plan.source))",
        ),
    ),
    mistake(
        "statistics_not_reset",
        "training",
        (
            CONTROL,
            "plan, fresh = GatherPlan(source, survivors.size), empty_statistics(source.size)",
            "plan, fresh = GatherPlan(source, survivors.size), "
            "DensityStatistics(statistics.gradient_sum[source], statistics.visits[source])",
        ),
    ),
    mistake(
        "residual_steps_from_start",
        "training",
        (
            TRAINER,
            "    dense, state.ahead = densify_now(iteration, config), None\n",
            "    dense, state.ahead = densify_now(iteration, config), None\n    for name in "
            "set(state.adam.step) & {'appearance_coefficients', 'motion_coefficients'}:\n        "
            "state.adam.step[name] = iteration - 1\n",
        ),
    ),
    mistake(
        "skipped_step_when_densifying",
        "training",
        (
            TRAINER,
            "if not (dense and config.optimiser.legacy_skip):",
            "if not (dense and not config.optimiser.legacy_skip):",
        ),
    ),
    mistake(
        "calibration_of_half_ratio",
        "training",
        (TRAINER, "(state.lambda_lap or 0.0)", "0.5 * (state.lambda_lap or 0.0)"),
        (STAGE, '"lambda_lap": weight', '"lambda_lap": 0.5 * weight'),
    ),
    mistake(
        "frame_order_of_all_frames",
        "training",
        (
            TRAINER,
            "targets, camera = shop.observed(view)",
            "k = int(np.searchsorted(shop.sequence.train_index, view.index))\n    view = "
            "view._replace(index=k, t=float(shop.sequence.times[k]))\n    targets, camera = shop.observed(view)",
        ),
    ),
    mistake(
        "visible_if_in_front",
        "training",
        (
            TRAINER,
            "    watched = statistics_active(iteration, config)\n",
            "    watched = statistics_active(iteration, config)\n    d_scene = "
            "d_scene._replace(visible=render_saved.projected.visible)\n",
        ),
    ),
]
WHOLE = [
    mistake(
        "motion_of_normalised_atoms",
        "scene objective",
        (
            MODEL,
            "motion_forward(coefficients, phi.astype(coefficients.dtype))",
            "motion_forward(coefficients, normalised_atoms(t, spectral.omega, "
            "spectral.statistics).astype(coefficients.dtype))",
        ),
    ),
    mistake(
        "appearance_of_raw_atoms",
        "scene objective",
        (
            MODEL,
            "appearance_forward(coefficients, phi_bar.astype(coefficients.dtype), model.beta)",
            "appearance_forward(coefficients, dictionary_forward(t, "
            "spectral.omega)[0].astype(coefficients.dtype), model.beta)",
        ),
    ),
    mistake(
        "statistics_over_all_frames",
        "scene objective",
        (
            "stages.requests",
            'spectral_from(model_of(settings), inputs["times"][inputs["train_index"]].astype(np.float64))',
            'spectral_from(model_of(settings), inputs["times"].astype(np.float64))',
        ),
    ),
    mistake(
        "pixel_corner_camera",
        "render objective",
        (
            "splatting.camera_model",
            "        real(camera.cx),\n        real(camera.cy),",
            "        real(camera.cx + 0.5),\n        real(camera.cy + 0.5),",
        ),
    ),
    mistake(
        "view_direction_not_to_position",
        "render objective",
        (RENDER, "projection.d_position + harmonics.d_position", "projection.d_position + 0 * harmonics.d_position"),
    ),
    mistake(
        "view_direction_not_to_pose",
        "render",
        (RENDER, "_pose_gradient(projection.d_camera, harmonics.d_centre, saved.camera)", "projection.d_camera"),
    ),
    mistake(
        "optical_centre_is_translation",
        "render",
        (
            RENDER,
            "scene.harmonics, scene.residual, scene.position, camera_centre(camera), degree",
            "scene.harmonics, scene.residual, scene.position, np.array(camera.translation), degree",
        ),
    ),
    mistake("ssim_sign", "objective", (OBJECTIVE, "loss += ssim_weight * (1.0 - ssim)", "loss += ssim_weight * ssim")),
    mistake(
        "l1_not_reduced",
        "objective",
        (OBJECTIVE, "(1.0 - ssim_weight) * l1, ", "l1, "),
        (OBJECTIVE, "masked_l1_reverse(1.0 - ssim_weight, l1_saved)", "masked_l1_reverse(1.0, l1_saved)"),
    ),
    mistake(
        "depth_term_dropped",
        "objective",
        (OBJECTIVE, "depth_target(frame.depth, frame.mask) if config.loss.depth_weight > 0 else None", "None"),
    ),
    mistake(
        "laplacian_gradient_dropped",
        "objective",
        (
            OBJECTIVE,
            "        if term.d_colour is not None:\n",
            '        if term.d_colour is not None and name != "laplacian":\n',
        ),
    ),
    mistake(
        "depth_loss_gradient_dropped",
        "objective",
        (
            OBJECTIVE,
            "        if term.d_depth is not None:\n",
            '        if term.d_depth is not None and name != "depth":\n',
        ),
    ),
    mistake(
        "penalty_gradient_dropped",
        "objective",
        (VIEW, '        gradients["motion_coefficients"] += matern', "        _ = matern"),
    ),
    mistake(
        "deformation_of_position_only",
        "objective",
        (
            VIEW,
            "        fdm = deformation_reverse(d_offsets, scene_saved.deformation)",
            "        d_offsets[3:] = 0\n        fdm = deformation_reverse(d_offsets, scene_saved.deformation)",
        ),
    ),
    mistake(
        "screen_gradient_in_ndc",
        "render",
        (
            RENDER,
            "        d_mean2d=d_mean2d,\n",
            "        d_mean2d=d_mean2d * np.array([[0.5 * saved.camera.width], [0.5 * "
            "saved.camera.height]], d_mean2d.dtype),\n",
        ),
    ),
    mistake(
        "depth_gradient_dropped",
        "render objective",
        (RENDER, "keep_depth=not deviations.drop_depth_to_z,", "keep_depth=False,"),
    ),
]
MISTAKES = [*in_images.MISTAKES, *TRAINING, *WHOLE]
