"""The objective of one view is the weighted sum of its terms, each taken from its own module."""

import msgspec
import numpy as np
import pytest
from terms import TERMS, alone

from endotsr.clips.sequences.sequence import Frame
from endotsr.config import PAPER
from endotsr.method.equations.calibration import rms
from endotsr.method.splatting.camera import Camera
from endotsr.method.splatting.render import RenderOut
from endotsr.training.fitting import objective
from endotsr.training.fitting.objective import LossWeights, calibrate_on, frame_targets, image_loss, photometric_loss

WIDTH, HEIGHT = 20, 16
CAMERA = Camera(np.eye(3), np.zeros(3), 20.0, 20.0, WIDTH / 2, HEIGHT / 2, WIDTH, HEIGHT)
WEIGHTS = LossWeights(*(0.3 * 1.5**k for k in range(len(TERMS))))
OFF = LossWeights(*(0.0 for _ in TERMS))


@pytest.fixture
def frame():
    rng = np.random.default_rng(5)
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[:5, :6] = False
    image = np.where(mask, rng.uniform(0.2, 0.8, (3, HEIGHT, WIDTH)), 0.9)
    return Frame(image, mask, rng.uniform(2.0, 3.0, (HEIGHT, WIDTH)), 0.25, CAMERA)


@pytest.fixture
def rendered():
    rng = np.random.default_rng(6)
    image, depth = rng.uniform(0, 1, (3, HEIGHT, WIDTH)), rng.uniform(1.0, 4.0, (HEIGHT, WIDTH))
    return RenderOut(image, depth, np.ones((HEIGHT, WIDTH)))


def with_loss(**changes):
    return msgspec.structs.replace(PAPER, loss=msgspec.structs.replace(PAPER.loss, **changes))


def test_targets_of_terms_that_are_on(frame):
    targets = frame_targets(frame, PAPER)
    assert (targets.image[:, ~frame.mask] == 0).all()
    np.testing.assert_array_equal(targets.image[:, frame.mask], frame.image[:, frame.mask])
    assert targets.ssim is not None and targets.ssim.count == 3 * frame.mask.sum()
    assert targets.depth is not None and targets.depth.count == frame.mask.sum()
    assert targets.supports is not None


def parts(rendered, frame):
    """Value and gradients (by colour, by depth) of each term at weight 1, from its own module."""
    return {name: alone(name, rendered, frame) for name in ("l1", *TERMS)}


def test_no_two_terms_have_the_same_weight_value_or_gradient(frame, rendered):
    """Each is told from the others, and none is 0."""
    values = [*WEIGHTS, *(value for value, _, _ in parts(rendered, frame).values())]
    assert all(values) and len({*values}) == len(values)
    assert all(np.any(by_colour) or np.any(by_depth) for _, by_colour, by_depth in parts(rendered, frame).values())


@pytest.mark.parametrize("on", ["all", "none", *TERMS])
def test_the_objective_is_the_weighted_sum_of_its_terms(frame, rendered, on):
    weights = WEIGHTS if on == "all" else OFF if on == "none" else OFF._replace(**{on: getattr(WEIGHTS, on)})
    found = image_loss(rendered, frame_targets(frame, PAPER), weights, PAPER.loss)
    terms = parts(rendered, frame)
    factors = {"l1": 1 - weights.ssim, "ssim": -weights.ssim, **weights._asdict()} | {"ssim": -weights.ssim}
    wanted = {name: terms[name] for name in terms if name == "l1" or getattr(weights, name) > 0}
    assert found.terms == pytest.approx({name: value for name, (value, _, _) in wanted.items()}, rel=1e-13)
    loss = weights.ssim + sum(factors[name] * value for name, (value, _, _) in wanted.items())
    assert found.loss == pytest.approx(loss, rel=1e-13)
    for got, place in ((found.d_colour, 1), (found.d_depth, 2)):
        gradient = sum((factors[name] * term[place] for name, term in wanted.items()), np.zeros(got.shape))
        np.testing.assert_allclose(got, gradient, rtol=1e-11, atol=1e-16)


def test_a_term_without_its_target_is_left_out_and_no_other(frame, rendered):
    """Image and mask belong to all of them; edges are found as they are needed."""
    whole, every = frame_targets(frame, PAPER), {"l1", *TERMS}

    def left_out(*names):
        bare = whole._replace(**dict.fromkeys(names))
        return every - image_loss(rendered, bare, WEIGHTS, PAPER.loss).terms.keys()

    optional = set(whole._fields) - {"image", "mask"}
    by_target = {name: left_out(name) for name in optional}
    assert by_target | {"ssim": {"ssim"}, "depth": {"depth"}, "supports": {"laplacian"}} == by_target
    assert all(by_target.values()) and left_out(*optional) == set().union(*by_target.values()) <= every - {"smoothness"}


def test_nothing_is_rendered_for_the_depth_of_a_photometric_loss(frame, rendered):
    found = photometric_loss(rendered.colour, frame_targets(frame, PAPER), 0.3)
    assert set(found.terms) == {"l1", "ssim"} and found.d_depth.size == 0


class Clip:
    """A sequence of the one frame, seen three times."""

    train_index, names = np.array([4, 7, 9]), [f"frame {i}" for i in range(10)]

    def __init__(self, frame):
        self._frame, self.asked = frame, []

    def frame(self, index, dtype):
        self.asked.append((index, np.dtype(dtype)))
        return self._frame


@pytest.mark.parametrize("laplacian", [True, False])
def test_calibration_is_the_ratio_of_the_gradients_at_the_render(frame, rendered, monkeypatch, laplacian):
    """r / median(g_lap / g_rgb), with a pyramid of its own where the model has none."""
    config = with_loss(ssim_weight=0.3, calibration_views=2)
    config = msgspec.structs.replace(config, model=msgspec.structs.replace(config.model, laplacian=laplacian))
    left_out: list[dict] = []
    monkeypatch.setattr(objective, "render_at", lambda *_, **without: left_out.append(without) or rendered)
    scene, clip = type("Scene", (), {"position": np.zeros((3, 1))}), Clip(frame)
    found = calibrate_on(scene, None, clip, config)  # type: ignore[arg-type]
    terms = parts(rendered, frame)
    ratio = rms(terms["laplacian"][1]) / rms(0.7 * terms["l1"][1] - 0.3 * terms["ssim"][1])
    assert found.lambda_lap == pytest.approx(config.loss.gradient_ratio / ratio, rel=1e-12)
    assert clip.asked == [(4, np.dtype(np.float64)), (9, np.dtype(np.float64))]
    assert "frame 4" in found.table and "frame 9" in found.table
    assert left_out == [{"frames": None, "appearance": False, "spectral_motion": False}] * 2  # a rule of the base model
