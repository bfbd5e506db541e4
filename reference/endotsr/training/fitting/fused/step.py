"""One Adam step of all trained arrays, from the gradients with respect to the deformed scene.

If the gradient of an array is much larger than its factors (time bases, Fourier coefficients), one sweep computes the
reverse pass and the step, and the gradient is never stored. The sweep over the time bases also computes the offsets of
the next iteration.
"""

from endotsr.config import Config
from endotsr.method.equations.appearance import argument_gradient
from endotsr.method.equations.matern import penalty_factors
from endotsr.method.kernels.threads import parallel_calls
from endotsr.method.kernels.timer import NO_TIMER, Timer, timed
from endotsr.method.splatting.render import RenderGrads
from endotsr.training.fitting.adam import AdamState, Rate, adam_update
from endotsr.training.fitting.fused.coefficients import coefficients_adam_step
from endotsr.training.fitting.fused.deformation import NAMES as FDM_FIELDS
from endotsr.training.fitting.fused.deformation import FdmArrays, deformation_adam_step
from endotsr.training.fitting.model import OffsetsAhead, SceneGrads, SceneSaved, Spectral
from endotsr.training.scene.gaussians import Gaussians, arrays


def optimise(
    gaussians: Gaussians,
    adam: AdamState,
    spectral: Spectral,
    config: Config,
    saved: SceneSaved,
    grads: RenderGrads,
    back: SceneGrads,
    rates: dict[str, Rate],
    next_time: float | None = None,
    timer: Timer = NO_TIMER,
) -> OffsetsAhead | None:
    """Update the Gaussians and their moments in place.

    gaussians  the parameters, updated in place
    saved      of `scene_at`, for the same Gaussians: times, atoms and slopes, which are only read
    grads      gradients with respect to the deformed scene
    back       of `scene_reverse(..., coefficients=False)`: gradients of the arrays without a fused sweep
    rates      learning rate of every array
    next_time  normalised time of the next iteration; None if unknown
    timer      records the stages "FDM" and "Adam"
    returns    offsets of the FDM at that time, for `scene_at`; None without `next_time` or FDM
    """
    o = config.optimiser
    settings = (o.beta1, o.beta2, o.epsilon)

    def step_deformation() -> OffsetsAhead | None:
        if saved.deformation is None:
            return None
        assert back.d_offsets is not None
        fdm_rates = {name: rates[name] for name in FDM_FIELDS}
        fdm = FdmArrays(*(getattr(gaussians, name) for name in FDM_FIELDS))
        offsets = deformation_adam_step(back.d_offsets, fdm, saved.deformation, adam, fdm_rates, *settings, next_time)
        return None if next_time is None or offsets is None else OffsetsAhead(next_time, offsets)

    def step_appearance() -> None:
        if saved.appearance is not None:
            assert grads.d_residual is not None and gaussians.appearance_coefficients is not None
            d_argument, atoms = argument_gradient(grads.d_residual, saved.appearance), saved.appearance.phi_bar
            coefficients = gaussians.appearance_coefficients
            coefficients_adam_step(
                d_argument, atoms, None, coefficients, adam, "appearance_coefficients", rates, *settings
            )

    def step_motion() -> None:
        if saved.motion is not None:
            coefficients, atoms, weight = gaussians.motion_coefficients, saved.motion.phi, config.loss.lambda_msp
            assert coefficients is not None
            sums, dtype = grads.d_position, coefficients.dtype
            shrink = penalty_factors(weight, spectral.rho, gaussians.count, dtype) if weight > 0 else None
            coefficients_adam_step(sums, atoms, shrink, coefficients, adam, "motion_coefficients", rates, *settings)

    ahead, *_ = parallel_calls(  # independent arrays; the longest sweep is listed first
        timed(timer, "FDM", step_deformation),
        timed(timer, "Adam", step_appearance),
        timed(timer, "Adam", step_motion),
        timed(timer, "Adam", lambda: adam_update(adam, arrays(gaussians), back.by_field, rates, *settings)),
    )
    return ahead
