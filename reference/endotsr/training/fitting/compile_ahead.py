"""A cold start on two cores: two processes compile the kernels of a training at the same time.

A process-wide lock serialises compilation, so threads do not help. While this process compiles the forward and reverse
pass of rendering, a second one compiles losses and optimiser. Each loads the other's code from the kernel cache. The
second process then compiles the terms that the schedule activates later. No result depends on this: a kernel missing
at its first call is compiled then.

`python -m endotsr.training.fitting.compile_ahead` runs the second process, with settings as JSON on standard input.
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from endotsr.config import PAPER, Config, with_settings
from endotsr.method.kernels.machine import usable_cores
from endotsr.method.kernels.target import compiled_for

if TYPE_CHECKING:
    from endotsr.training.fitting.state import TrainingConstants, TrainingState

READY = "ready for the first iteration"
_helpers: list[subprocess.Popen] = []  # referenced until this process ends, which does not wait for them


def compile_ahead(config: Config, say: Callable[[str], object] = lambda line: None) -> bool:
    """Compile the kernels of a training with these settings on two cores, unless the kernel cache has them.

    say      receives a message for the user if something is compiled
    returns  whether anything was compiled; never with one core or with the JIT off
    """
    import numba

    if numba.config.DISABLE_JIT or usable_cores() < 2 or done_before(config).exists():  # type: ignore[attr-defined]
        return False
    say("compiling for this machine, once; this takes about 30 seconds")
    helper = _second(config)
    rehearse_picture(*_small(config))
    if helper is not None and helper.stdout is not None:
        helper.stdout.readline()  # READY, or end of file if the process failed
    return True


def _second(config: Config) -> subprocess.Popen | None:
    """The second process; None if it cannot be started. A kernel that fails there fails again here when called."""
    try:
        helper = subprocess.Popen(
            [sys.executable, "-m", __spec__.name],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        _helpers.append(helper)
        assert helper.stdin is not None
        with helper.stdin as settings:
            settings.write(msgspec.json.encode(config))
    except OSError:
        return None
    return helper


def done_before(config: Config) -> Path:
    """Marker file: all kernels of this source and these components are compiled for this processor."""
    from endotsr.method.kernels.kernel_cache import kernel_folder

    model = config.model
    parts = [name for name in ("deformation", "appearance", "spectral_motion", "laplacian") if getattr(model, name)]
    words = (config.training.precision, *parts, config.raster.preset, compiled_for())
    return kernel_folder() / f"compiled-{'-'.join(words)}"


def rehearse(config: Config) -> None:
    """Compile or load every kernel of a training with these settings in this process, before any timing."""
    constants, state = _small(config)
    rehearse_picture(constants, state)
    rehearse_losses(constants, everything=True)
    rehearse_optimiser(constants, state)
    rehearse_residuals(constants, state)
    rehearse_densification(constants, state)


def _small(config: Config) -> tuple["TrainingConstants", "TrainingState"]:
    """Constants and state of a few Gaussians and pixels, with the dtypes and layouts of any training."""
    from endotsr.training.fitting.state import bench_state, training_constants
    from endotsr.training.scene import workload

    if config.density.extent == "cameras":  # those of the workload coincide
        config = with_settings(config, density={"extent": PAPER.density.extent})
    constants = training_constants(workload.sequence(64, 48, frames=3), config)
    return constants, bench_state(workload.gaussians(64, config), config, 0)


def rehearse_picture(constants: "TrainingConstants", state: "TrainingState") -> None:
    """Deformation, splatting and its reverse pass, density statistics."""
    from endotsr.method.splatting.render import render_forward, render_reverse
    from endotsr.training.fitting.model import raster_settings, scene_at, scene_reverse, without
    from endotsr.training.scene.density_control import gather_statistics

    config, camera = constants.config, constants.sequence.cameras[0]
    base = without(state.gaussians, appearance=False, spectral_motion=False)
    scene, saved = scene_at(base, constants.spectral, config.model, 0.5)
    out, render_saved = render_forward(scene, camera, raster_settings(config), degree=0)
    grads = render_reverse(out.colour, out.depth, None, render_saved)
    gather_statistics(state.statistics, grads.d_mean2d, grads.visible, camera.width, camera.height)
    scene_reverse(grads, saved, coefficients=False)


def rehearse_losses(constants: "TrainingConstants", everything: bool) -> None:
    """Targets, losses and optimiser; with `everything` also the terms that the schedule activates later."""
    import numpy as np

    from endotsr.clips.flow.between import Flows, motion_between
    from endotsr.clips.flow.between_kernels import moved_priors
    from endotsr.method.losses.masked_ssim import stored_target
    from endotsr.method.splatting.render import RenderOut
    from endotsr.training.fitting.objective import full_weights, image_loss

    config = constants.config
    frame = constants.sequence.frame(0, config.training.precision)
    later = full_weights(config.loss, float(config.model.laplacian))
    weights = later if everything else later._replace(smoothness=0.0, laplacian=0.0)
    seen = RenderOut(1 - frame.image, 1 + frame.depth, 1 + frame.depth)  # no loss term is zero, so every kernel runs
    image_loss(seen, constants.targets_of(0), weights, config.loss)
    if config.training.bridge_fraction > 0:  # bridged images are stored in finer steps
        stored_target(np.zeros(frame.image.shape, np.uint16), 1, frame.mask, config.training.precision)
        flow, pair = np.zeros((2, *frame.mask.shape), np.float32), [0, 0]
        field = motion_between(Flows(flow, flow), 0.5)
        moved_priors(constants.sequence.masks[pair], constants.sequence.depth[pair], field, np.zeros(2, np.float32))


def rehearse_optimiser(constants: "TrainingConstants", state: "TrainingState") -> None:
    """Adam, fused with the reverse pass of the deformation."""
    import numpy as np

    from endotsr.method.equations.deformation import CHANNELS, DeformationSaved
    from endotsr.training.fitting.adam import adam_update
    from endotsr.training.fitting.fused.deformation import NAMES, FdmArrays, deformation_adam_step
    from endotsr.training.fitting.schedules import learning_rates
    from endotsr.training.scene.gaussians import arrays

    config, rates, o = constants.config, learning_rates(1, constants.config), constants.config.optimiser
    given = {name: array for name, array in arrays(state.gaussians).items() if name in rates and name not in NAMES}
    adam_update(state.adam, given, given, rates, o.beta1, o.beta2, o.epsilon)
    fdm = FdmArrays(*(getattr(state.gaussians, name) for name in NAMES))
    if fdm.weight is not None:
        saved = DeformationSaved(*fdm, 0.5, config.model.basis)
        d_offsets = np.zeros((CHANNELS, fdm.weight.shape[2]), fdm.weight.dtype)
        fdm_rates = {name: rates[name] for name in NAMES}
        deformation_adam_step(d_offsets, fdm, saved, state.adam, fdm_rates, o.beta1, o.beta2, o.epsilon)


def rehearse_residuals(constants: "TrainingConstants", state: "TrainingState") -> None:
    """Both Fourier residuals, the penalty, and their reverse passes fused with Adam."""
    import numpy as np

    from endotsr.method.equations.appearance import appearance_forward
    from endotsr.method.equations.matern import matern_penalty_forward, penalty_factors
    from endotsr.method.equations.motion import motion_forward
    from endotsr.training.fitting.fused.coefficients import coefficients_adam_step
    from endotsr.training.fitting.schedules import learning_rates

    activated = constants.config.training.residual_activation + 1
    rates, o, rho = learning_rates(activated, constants.config), constants.config.optimiser, constants.spectral.rho
    colour, motion = state.gaussians.appearance_coefficients, state.gaussians.motion_coefficients
    for name, coefficients in (("appearance_coefficients", colour), ("motion_coefficients", motion)):
        if coefficients is None:
            continue
        atoms, shrink = np.zeros(coefficients.shape[1], coefficients.dtype), None
        if coefficients is colour:
            sums, _ = appearance_forward(coefficients, atoms, constants.config.model.beta)
        else:
            sums, _ = motion_forward(coefficients, atoms)
            matern_penalty_forward(coefficients, rho)
            shrink = penalty_factors(1.0, rho, state.gaussians.count, coefficients.dtype)
        settings = (o.beta1, o.beta2, o.epsilon)
        coefficients_adam_step(sums, atoms, shrink, coefficients, state.adam, name, rates, *settings)


def rehearse_densification(constants: "TrainingConstants", state: "TrainingState") -> None:
    """The gather of every array and of its moments."""
    from endotsr.training.fitting.adam import regather
    from endotsr.training.scene.density_control import densify

    state.statistics.gradient_sum[:] = 1.0
    state.statistics.visits[:] = 1
    made = densify(state.gaussians, state.statistics, constants.config.density, state.rng, constants.extent)
    regather(state.adam, list(state.adam.first), made.plan.source, made.plan.survivors)


def _second_process() -> None:
    """Compile everything but rendering; print READY after the kernels of the first iteration."""
    from endotsr.method.kernels.threads import use_threads

    config = msgspec.json.decode(sys.stdin.buffer.read(), type=Config)
    use_threads(1)
    constants, state = _small(config)
    rehearse_losses(constants, everything=False)
    rehearse_optimiser(constants, state)
    print(READY, flush=True)
    rehearse_residuals(constants, state)
    rehearse_losses(constants, everything=True)
    rehearse_densification(constants, state)
    done_before(config).touch()


if __name__ == "__main__":
    _second_process()
