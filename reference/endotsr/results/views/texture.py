"""Views of the recording with the texture that its training frames record: `endotsr render --texture`.

In: a scene, its sequence, and rendered views. Out: the same views, whose colour has the texture of the training frames
around their time (`results.evaluation.recorded_texture`); depth and opacity stay as they are.
"""

from collections.abc import Iterator
from functools import lru_cache

from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.render import RenderOut
from endotsr.results.evaluation.recorded_texture import around, textured
from endotsr.results.export.scene import MovingScene
from endotsr.results.views.pictures import ReadFrames
from endotsr.results.views.plan import PlannedView
from endotsr.training.runs.sources import load_run_sequence

KEPT = 4  # cached renders of training frames


def check_texture(scene: MovingScene) -> None:
    """Raises InputError for a scene without the frames of one training."""
    if scene.folder is None:
        raise InputError("render: --texture needs the frames of one training; use a run folder without windows")


def with_texture(
    scene: MovingScene,
    views: Iterator[tuple[PlannedView, RenderOut]],
    known: ReadFrames | None = None,
    source: str | None = None,
    taken_out: tuple[str, ...] = (),
) -> Iterator[tuple[PlannedView, RenderOut]]:
    """The views, from cameras of the recording, with recorded texture in their colour (3, H, W), in [0, 1].

    known       the frames of the run, if they were read
    source      its current location; default: the recorded one
    taken_out   spectral components that the renders lack

    Raises:  InputError if the sequence is missing, or is not that of the run
    """
    assert scene.folder is not None
    sequence = known if isinstance(known, Sequence) else load_run_sequence(scene.folder, source)

    @lru_cache(KEPT)
    def own(index: int) -> FloatArray:
        return scene.render(float(sequence.times[index]), scene.cameras[index], taken_out).colour

    for view, out in views:
        colour = textured(sequence, around(sequence, view.time), out.colour, own)
        yield view, out._replace(colour=colour)
