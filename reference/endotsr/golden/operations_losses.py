"""Operations of the base losses (B6) to (B9)."""

from numpy.typing import NDArray

from endotsr.golden.operation import Asked, Inputs, Operation, Settings
from endotsr.losses.depth import depth_target, normalised_depth_forward, normalised_depth_reverse
from endotsr.losses.masked_l1 import masked_l1_forward, masked_l1_reverse
from endotsr.losses.masked_ssim import masked_ssim_forward, masked_ssim_reverse, ssim_target
from endotsr.losses.smoothness import smoothness_forward, smoothness_reverse

Found = dict[str, NDArray | float]


def _l1(inputs: Inputs, settings: Settings) -> Found:
    loss, saved = masked_l1_forward(inputs["rendered"], inputs["observed"], inputs["mask"])
    return {"loss": loss, "d_rendered": masked_l1_reverse(float(inputs["d_loss"]), saved)}


def _ssim(inputs: Inputs, settings: Settings) -> Found:
    ssim, saved = masked_ssim_forward(inputs["rendered"], ssim_target(inputs["observed"], inputs["mask"]))
    return {"ssim": ssim, "d_rendered": masked_ssim_reverse(float(inputs["d_ssim"]), saved)}


def _depth(inputs: Inputs, settings: Settings) -> Found:
    target = depth_target(inputs["prior_depth"], inputs["mask"])
    loss, saved = normalised_depth_forward(inputs["rendered_depth"], target)
    return {"loss": loss, "d_rendered_depth": normalised_depth_reverse(float(inputs["d_loss"]), saved)}


def _smoothness(inputs: Inputs, settings: Settings) -> Found:
    images = (inputs["rendered_depth"], inputs["rendered"], inputs["mask"], inputs["edges"])
    loss, saved = smoothness_forward(*images, settings["total_variation_factor"])
    grads = smoothness_reverse(float(inputs["d_loss"]), saved)
    return {"loss": loss, "d_rendered": grads.rendered, "d_rendered_depth": grads.rendered_depth}


TEXTBOOK = 2e-4  # E[x^2] - E[x]^2 in float32 over C2 = 9e-4: the usual form of SSIM loses this much
PER_DISPLAY, PER_LENGTH = "loss per display unit", "loss per scene unit"

OPERATIONS = [
    Operation("masked_l1", "B6", "masked L1", _l1, {
        "loss": Asked(1, "display", oracle="losses.masked_l1"), "d_rendered": Asked(2, PER_DISPLAY),
    }, lambda s: ("masked_l1",)),
    Operation("masked_ssim", "B7", "masked SSIM", _ssim, {
        "ssim": Asked(1, oracle="losses.masked_ssim", least32=TEXTBOOK),
        "d_rendered": Asked(2, PER_DISPLAY, oracle="losses.masked_ssim_gradient", least32=TEXTBOOK),
    }, lambda s: ("masked_ssim",)),
    Operation("normalised_depth", "B8", "normalised depth", _depth, {
        "loss": Asked(1, oracle="losses.normalised_depth"),
        "d_rendered_depth": Asked(2, PER_LENGTH, oracle="losses.normalised_depth"),
    }, lambda s: ("normalised_depth",)),
    Operation("smoothness", "B9", "smoothness with given edges", _smoothness, {
        "loss": Asked(1, "scene unit^2", oracle="losses.smoothness"),
        "d_rendered": Asked(2, PER_DISPLAY, oracle="losses.smoothness"),
        "d_rendered_depth": Asked(2, PER_LENGTH, oracle="losses.smoothness"),
    }, lambda s: ("smoothness",)),
]  # fmt: skip
