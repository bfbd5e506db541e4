"""Points that are followed through a recording, across its seams."""

import numpy as np
import pytest
from pages.recordings.seam_errors import STEP, seam_errors
from small_recording import trained, write_recording

from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.simulator.recorded import recorded_positions
from endotsr.errors import InputError
from endotsr.studies.windows.follow import followed, seam
from endotsr.studies.windows.plan import Wanted
from endotsr.studies.windows.scene import WindowFrames, open_windows


@pytest.fixture(scope="module")
def scene(cold_run):
    return open_windows(cold_run)  # windows 0:32 and 24:56


def centres(scene, k, frame):
    return scene.window(k).at(scene.local_time(k, frame)).position


def test_the_seam_is_the_middle_of_an_overlap(scene):
    assert (seam(scene, 0), seam(scene, 1), seam(scene, -1)) == (28, None, None)


def test_a_point_on_a_lonely_gaussian_moves_with_it(scene):
    """The Gaussian that is farthest from all others: its weight is nearly 1 within its own window."""
    start, end = (centres(scene, 0, g).astype(float) for g in (2, 20))
    apart = np.linalg.norm(start[:, :, None] - start[:, None], axis=0) + 1e9 * np.eye(start.shape[1])
    lonely = int(apart.min(axis=1).argmax())
    point = start[:, [lonely]]
    found = followed(scene, point, 2, [2, 20])
    np.testing.assert_array_equal(found[0], point)
    wanted = end[:, lonely] - start[:, lonely]
    assert np.linalg.norm(found[1, :, 0] - point[:, 0] - wanted) < 0.35 * np.linalg.norm(wanted)


def test_a_path_is_continuous_at_the_seam_and_goes_on_with_the_other_window(scene):
    points = centres(scene, 0, 20)[:, ::20].astype(float)
    path = followed(scene, points, 20, range(20, 40))
    assert np.isfinite(path).all()
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1).mean(axis=1)  # frame 28 is path[8]
    assert steps[8] < 3 * np.median(steps)
    behind = followed(scene, path[8], 28, [28, 36])  # frame 28 belongs to window 0, and the walk passes to window 1
    np.testing.assert_allclose(behind[1], path[16], atol=1e-9)
    near = np.linalg.norm(centres(scene, 1, 28)[:, None] - path[8][:, :, None], axis=0).argmin(axis=1)
    moves = (centres(scene, 1, 36) - centres(scene, 1, 28))[:, near]
    assert np.corrcoef((path[16] - path[8]).ravel(), moves.ravel())[0, 1] > 0.8


def test_the_order_of_the_frames_has_no_part_in_it_and_the_past_is_followed_too(scene):
    points = centres(scene, 1, 40)[:, ::30].astype(float)
    one = followed(scene, points, 40, [50, 10, 40, 30])
    for g, row in zip((50, 10, 40, 30), one):
        np.testing.assert_array_equal(followed(scene, points, 40, [g])[0], row)
    assert np.isfinite(one).all()


def test_nothing_is_followed_across_a_cut(tmp_path):
    from small_recording import settings

    source = write_recording(tmp_path / "source")
    for i in (28, 29):
        (source / "depth" / f"{i:06d}.png").write_bytes(b"")
    trained(source, tmp_path / "run", Wanted(), settings(4))
    cut = open_windows(tmp_path / "run")
    found = followed(cut, centres(cut, 0, 4)[:, :5].astype(float), 4, [20, 40])
    assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()
    with pytest.raises(InputError, match="no window covers"):
        followed(cut, np.zeros((3, 1)), 4, [29])
    with pytest.raises(InputError, match="use windows with seams"):
        seam_errors(cut, lambda g: np.ones((40, 48), bool), lambda g, other: np.zeros((3, 40, 48)))


def test_the_error_of_points_that_follow_the_truth_is_that_of_the_truth(scene, recording):
    """The simulated truth, and a made-up one that moves more: the lengths are those of this recording."""
    frames = WindowFrames(scene)
    positions = recorded_positions(recording, whole(recording))
    assert positions is not None

    def masks(g):
        k = scene.owner(g)
        return frames.of_window(k).masks[g - scene.plan.windows[k].first]

    found = seam_errors(scene, masks, positions)
    assert found.seams == 1 and 0 < found.across < 0.3 * found.across_motion
    assert 0 < found.inside < 0.3 * found.inside_motion
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("endotsr.studies.windows.follow.NEAREST", 8)
        few = seam_errors(scene, masks, positions)
    assert found.across < 0.96 * few.across and found.inside < 0.96 * few.inside
    far = seam_errors(scene, masks, lambda g, other: positions(g, other) + (10.0 if g != other else 0.0))
    assert far.across_motion == pytest.approx(10 * 3**0.5, rel=0.2) and far.across > found.across + 10
    assert STEP == 16


def whole(recording) -> Sequence:
    import endotsr

    return endotsr.load_sequence(recording)
