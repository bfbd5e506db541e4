"""Every layout has its section in docs/guides/prepare.md; the errors of poses in poses.md are computed rightly."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from endotsr.clips.sequences.layouts import layouts
from endotsr.method.splatting.camera import CameraPose

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guides" / "prepare.md"
SECTIONS = {"common": "The common format", "endonerf": "EndoNeRF", "stereomis": "StereoMIS", "tum": "TUM",
            "video": "Video", "points": "Points", "pictures": "Pictures", "colmap": "COLMAP", "hamlyn": "Hamlyn",
            "scared": "SCARED", "servct": "SERV-CT", "c3vd": "C3VD", "euroc": "EuRoC",
            "nerfstudio": "nerfstudio"}  # fmt: skip


def turned(poses, rotation, shift, factor=1.0):
    """The same path in another world, and in another unit."""
    return [
        CameraPose(p.rotation @ rotation.T, factor * (p.translation - p.rotation @ rotation.T @ shift)) for p in poses
    ]


def test_errors_of_a_path_do_not_depend_on_the_world_but_on_the_unit():
    from pages.recordings.path_errors import path_errors

    rng = np.random.default_rng(0)
    true = [
        CameraPose(Rotation.from_rotvec(0.1 * rng.normal(size=3)).as_matrix(), rng.normal(size=3)) for _ in range(9)
    ]
    moved = turned(true, Rotation.from_rotvec([0.4, -1.0, 0.3]).as_matrix(), np.array([3.0, -2.0, 9.0]))
    found = path_errors(moved, true, scaled=False)
    assert max(found[name] for name in ("error", "step", "step_degrees")) < 1e-6 and found["registered"] == 9
    longer = turned(true, np.eye(3), np.zeros(3), 2.0)
    assert (
        path_errors(longer, true, scaled=True)["error"] < 1e-9 < 0.1 < path_errors(longer, true, scaled=False)["error"]
    )
    wrong = [*moved[:4], moved[4]._replace(translation=moved[4].translation + [0.9, 0, 0]), *moved[5:]]
    assert 0.2 < path_errors(wrong, true, scaled=False)["error"] < 0.3  # 0.9 / sqrt(9), less what the alignment takes
    gaps = path_errors([None, *moved[1:4], None, *moved[5:]], true, scaled=False)
    assert gaps["registered"] == 7 and gaps["error"] < 1e-6
    assert "error" not in path_errors([None] * 7 + moved[7:], true, scaled=False)


def test_every_layout_has_its_section():
    text = PAGE.read_text(encoding="utf-8")
    assert {layout.name for layout in layouts()} == set(SECTIONS)
    for title in SECTIONS.values():
        assert f"\n## {title}\n" in text


def test_a_wrong_reading_is_restored_by_its_own_name_alone():
    from pages.recordings.pose_readings import WRONG, restored, world_to_camera

    from endotsr.clips.poses.agreement import Agreement

    rng = np.random.default_rng(3)
    turn, centre = Rotation.from_rotvec(0.3 * rng.normal(size=(6, 3))).as_matrix(), 20 * rng.normal(size=(6, 3))
    true = world_to_camera(turn, centre)
    for wrong, name in (("inverse", "inverse"), ("LLFF's axes", "LLFF axes"), ("one frame late", "one frame late")):
        given = world_to_camera(*WRONG[wrong](turn, centre))
        said = {r: restored(Agreement("misread", 0, 0, 0, r), given, true) for r in ("inverse", "LLFF axes", name)}
        assert said == {r: r == name for r in said}
