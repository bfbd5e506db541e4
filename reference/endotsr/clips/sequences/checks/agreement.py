"""Poses, pictures and depth held against one another, for `check` and `prepare`.

In: a `Clip` and its cameras. Out: findings. Frames are read on demand, whatever the length of the clip: for each of at
most 24 pairs its first frame, and those at the gaps that are tried, usually one.
"""

from endotsr.clips.poses.agreement import Agreement, agreement
from endotsr.clips.poses.matches import Matcher
from endotsr.clips.poses.views import reduced_camera, side_of
from endotsr.clips.sequences.checks.kinds import Finding, finding
from endotsr.clips.sequences.clip import Clip
from endotsr.clips.sequences.view_frames import view_frame
from endotsr.errors import InputError
from endotsr.method.splatting.camera import Camera, CameraPose


def agreement_of(clip: Clip, cameras: list[Camera]) -> Agreement | None:
    """Whether the poses explain the pictures; None for a static camera, without depth, or with unreadable files."""
    if len(cameras) < 2 or all(camera is cameras[0] for camera in cameras) or clip.depth is None:
        return None
    side = side_of(cameras[0].width)
    matcher = Matcher(lambda k: view_frame(clip, k).reduced(side), clip.count, reduced_camera(cameras[0], side))
    try:
        return agreement(matcher, [CameraPose(camera.rotation, camera.translation) for camera in cameras])
    except InputError:
        return None  # another finding names the file


def agreement_findings(found: Agreement | None, where: str) -> list[Finding]:
    """The finding of an agreement that is not sound."""
    if found is None:
        return []
    if found.verdict == "misread":
        return [finding("pose-convention", where, f"{found.sentence}; {found.remedy}")]
    if found.verdict == "wrong":
        return [finding("pose-mismatch", where, found.sentence)]
    return [finding("pose-doubtful", where, found.sentence)] if found.verdict == "doubtful" else []
