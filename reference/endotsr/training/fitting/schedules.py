"""All schedules of the training, as pure functions of (iteration, configuration). Iterations count from 1.

Without state, the values of a resumed run are the same.
"""

from endotsr.config import NO_DENSIFICATION, Config
from endotsr.training.fitting.adam import Rate
from endotsr.training.scene.gaussians import DEFORMATION_CHANNELS, POSITION_CHANNELS


def exponential_decay(step: int, steps: int, initial: float, final: float) -> float:
    """initial^(1 - tau) final^tau, tau = clip(step / steps, 0, 1); 0 if an end is not positive.

    Edges: without steps, steps <= 0, tau is 0 up to step 0 and 1 from step 1 on.
    """
    if initial <= 0.0 or final <= 0.0:
        return 0.0
    fraction = min(max(step / steps, 0.0), 1.0) if steps > 0 else float(step > 0)
    return initial * (final / initial) ** fraction


def residuals_active(iteration: int, config: Config) -> bool:
    """Whether the spectral residuals are evaluated and trained at this iteration: after K_s, if the model has any."""
    has_any = config.model.appearance or config.model.spectral_motion
    return has_any and iteration > config.training.residual_activation


def residuals_activate(iteration: int, config: Config) -> bool:
    """Whether this is the first iteration with residuals; their arrays and moments are created before it."""
    return residuals_active(iteration, config) and not residuals_active(iteration - 1, config)


def motion_active(iteration: int, config: Config) -> bool:
    """Whether the spectral motion has a rate at this iteration; tracked motion (B15) has one from the first on."""
    tracked = config.model.spectral_motion and config.initialisation.motion != "none"
    return tracked or residuals_active(iteration, config)


def residual_decay(iteration: int, config: Config) -> float:
    """Factor on the residual rates, from 1 to `final_factor`.

    With `restart_residual_schedule` the decay spans the steps K_s .. iterations; otherwise it equals the base model's.
    """
    start = config.training.residual_activation if config.optimiser.restart_residual_schedule else 0
    return exponential_decay(iteration - start, config.training.iterations - start, 1.0, config.optimiser.final_factor)


def annealing(iteration: int, config: Config) -> float:
    """Factor on the non-decaying rates: 1 up to `annealing_from`, then exponentially to `annealed_factor`."""
    o = config.optimiser
    steps = config.training.iterations - o.annealing_from
    return exponential_decay(iteration - o.annealing_from, steps, 1.0, o.annealed_factor)


def learning_rates(iteration: int, config: Config) -> dict[str, Rate]:
    """Adam rates by field name of `Gaussians` and `FrameParameters` at this iteration.

    Rates of the spectral residuals are listed only while these are active, and then of both, also if the model has one
    of the two; rates of exposures and poses are listed only if the model has them.

    position, fdm_*   decay exponentially to `final_factor` of their initial rate over the whole run
    harmonics         constant up to `annealing`; separate rates for degree 0 and the higher degrees
    quaternion, log_scale, opacity_logit    constant up to `annealing`
    fdm_weight        the position channels have the extra `deformation_position_factor`
    exposure_*        decay like `position`
    pose_*            decay like `position`; the rate of the translation is in median depths of the tissue
    *_coefficients    their factor x deformation rate x `residual_decay`
    """
    o = config.optimiser
    decay = exponential_decay(iteration, config.training.iterations, 1.0, o.final_factor)
    deformation, constant = o.deformation * decay, annealing(iteration, config)
    rates: dict[str, Rate] = {
        "position": o.position * decay,
        "quaternion": o.rotation * constant,
        "log_scale": o.scale * constant,
        "opacity_logit": o.opacity * constant,
        "harmonics": ((slice(0, 1), o.harmonics_base * constant), (slice(1, None), o.harmonics_rest * constant)),
        "fdm_weight": (
            (POSITION_CHANNELS, deformation * o.deformation_position_factor),
            (slice(POSITION_CHANNELS.stop, DEFORMATION_CHANNELS), deformation),
        ),
        "fdm_centre": deformation,
        "fdm_width": deformation,
    }
    if config.model.exposure:
        rates["exposure_log_gain"] = rates["exposure_bias"] = o.exposure * decay
    if config.model.pose_correction:
        rates["pose_rotation"] = rates["pose_translation"] = o.pose * decay
    residual = o.deformation * residual_decay(iteration, config)
    if residuals_active(iteration, config):
        rates["appearance_coefficients"] = residual * o.appearance_factor
    if motion_active(iteration, config):
        rates["motion_coefficients"] = residual * o.spectral_motion_factor
    return rates


def laplacian_ramp(iteration: int, config: Config) -> float:
    """Active fraction of lambda_lap: 0 up to `laplacian_from`, 1 from `laplacian_full` on; 0 without component L."""
    if not config.model.laplacian or iteration <= config.loss.laplacian_from:
        return 0.0
    if iteration >= config.loss.laplacian_full:
        return 1.0
    return (iteration - config.loss.laplacian_from) / (config.loss.laplacian_full - config.loss.laplacian_from)


def smoothness_active(iteration: int, config: Config) -> bool:
    """Whether the smoothness terms are active at this iteration."""
    return config.loss.smoothness_weight > 0.0 and iteration >= config.loss.smoothness_from


def active_degree(iteration: int, config: Config) -> int:
    """Active harmonic degree, raised by one at every multiple of `harmonics_interval`."""
    return min(config.model.harmonics_degree, iteration // config.training.harmonics_interval)


def statistics_active(iteration: int, config: Config) -> bool:
    """Whether screen gradients are accumulated: before `until`, also after the last densification."""
    return iteration < config.density.until


def densifications_left(iteration: int, config: Config) -> int:
    """Number of densifications from this one, at which density control runs, to the last, both included; at least 1.

    The last one is that before `density.until`, also in a run that ends earlier.
    """
    density = config.density
    last = (density.until - 1) // density.interval
    return max(1, last - (iteration - 1) // density.interval)


def densify_now(iteration: int, config: Config) -> bool:
    """Whether Gaussians are cloned, split and pruned at this iteration: start < iteration < until, every `interval`."""
    density = config.density
    return density.start < iteration < density.until and iteration % density.interval == 0


def phases_never_reached(config: Config) -> list[str]:
    """The parts of a training that its length leaves out, each with its settings; the length is fixed.

    Parts that a switch or a weight of 0 leaves out are not named.
    """
    loss, density, training, last = config.loss, config.density, config.training, config.training.iterations
    residuals = ["A"] * config.model.appearance
    residuals += ["S"] * (config.model.spectral_motion and config.initialisation.motion == "none")
    densifies = any(densify_now(i, config) for i in range(density.interval, last + 1, density.interval))
    never = {
        f"the residuals of {' and '.join(residuals)} (training.residual_activation = {training.residual_activation})": (
            bool(residuals) and training.residual_activation >= last
        ),
        f"the Laplacian loss (loss.laplacian_from = {loss.laplacian_from})": (
            config.model.laplacian and loss.lambda_lap != 0 and loss.laplacian_from >= last
        ),
        f"the smoothness (loss.smoothness_from = {loss.smoothness_from})": (
            loss.smoothness_weight > 0 and loss.smoothness_from > last
        ),
        f"a densification (density.start = {density.start}, until = {density.until}, interval = {density.interval})": (
            density.until > NO_DENSIFICATION and not densifies
        ),
        f"the annealing (optimiser.annealing_from = {config.optimiser.annealing_from})": (
            config.optimiser.annealed_factor < 1 and config.optimiser.annealing_from >= last
        ),
        f"a harmonic degree above 0 (training.harmonics_interval = {training.harmonics_interval})": (
            config.model.harmonics_degree > 0 and training.harmonics_interval > last
        ),
        f"the coarse start, which ends at density.until = {density.until}": training.coarse_start
        and density.until == 0,
    }
    return [phase for phase, is_left_out in never.items() if is_left_out]
