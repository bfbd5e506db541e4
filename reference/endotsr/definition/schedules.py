"""Equations (6) and (B10): the schedules as functions of the iteration i = 1, 2, ... and the settings.

The rates of poses (B16) and of tracked motion (B15) before K_s are not among them.
"""

from endotsr.definition.exposure import EXPOSURES


def decay(step, steps, final):
    """final^tau, tau = clip(step / steps, 0, 1); without steps, tau = [step > 0]."""
    return final ** (min(max(step / steps, 0), 1) if steps > 0 else step > 0)  # (13.5)


def residuals_active(iteration, config):
    """[i > K_s], if the model has a residual."""
    return (config.model.appearance or config.model.spectral_motion) and iteration > config.training.residual_activation


def learning_rates(iteration, config):
    """Equation (B10): rates by array; parts of the leading axis as ((slice, rate), ...)."""
    o, total, activated = config.optimiser, config.training.iterations, config.training.residual_activation
    falling = decay(iteration, total, o.final_factor)
    constant = decay(iteration - o.annealing_from, total - o.annealing_from, o.annealed_factor)
    fdm = o.deformation * falling
    rates = {
        "position": o.position * falling,
        "quaternion": o.rotation * constant,
        "log_scale": o.scale * constant,
        "opacity_logit": o.opacity * constant,
        "harmonics": ((slice(0, 1), o.harmonics_base * constant), (slice(1, None), o.harmonics_rest * constant)),
        "fdm_weight": ((slice(0, 3), fdm * o.deformation_position_factor), (slice(3, 10), fdm)),
        **dict.fromkeys(("fdm_centre", "fdm_width"), fdm),
        **dict.fromkeys(EXPOSURES if config.model.exposure else (), o.exposure * falling),
    }
    if residuals_active(iteration, config):
        start = activated if o.restart_residual_schedule else 0
        residual = o.deformation * decay(iteration - start, total - start, o.final_factor)
        rates["appearance_coefficients"] = residual * o.appearance_factor
        rates["motion_coefficients"] = residual * o.spectral_motion_factor
    return rates


def laplacian_ramp(iteration, config):
    """Equation (6): fraction of lambda_lap in force."""
    first, full = config.loss.laplacian_from, config.loss.laplacian_full
    return min(1.0, max(0, iteration - first) / max(full - first, 1)) if config.model.laplacian else 0.0


def smoothness_active(iteration, config):
    """[i >= i_s], False for the weight 0."""
    return config.loss.smoothness_weight > 0 and iteration >= config.loss.smoothness_from


def active_degree(iteration, config):
    """Equation (6): harmonic degree."""
    return min(config.model.harmonics_degree, iteration // config.training.harmonics_interval)


def statistics_active(iteration, config):
    """Equation (B11): whether screen gradients are gathered."""
    return iteration < config.density.until


def densifications_left(iteration, config):
    """Equation (B11): runs of density control that are left, in an iteration that has one; at least 1."""
    d = config.density
    return max(1, (d.until - 1) // d.interval - (iteration - 1) // d.interval)


def densify_now(iteration, config):
    """Equation (B11): whether density control runs."""
    d = config.density
    return d.start < iteration < d.until and iteration % d.interval == 0
