"""All tests of a clip, in order: noise, blur and smoke, motion, then the others.

The tests of blur, smoke, motion, light and topology use the noise. Frames with blur or smoke, and those without tissue,
are excluded as reference, from motion and from topology. The test of light depends on the results of the tests of
motion and of the camera, that of topology on that of the camera.
"""

from typing import Any, NamedTuple

from endotsr.clips.effects.clarity import clarity_verdicts, clear_frames
from endotsr.clips.effects.frames import ReducedFrames, reduced_frames, with_clear_reference
from endotsr.clips.effects.motion import motion_verdict
from endotsr.clips.effects.noise import Noise, estimate_noise
from endotsr.clips.effects.periodic import Line
from endotsr.clips.effects.photometric import photometric_verdict
from endotsr.clips.effects.scope import camera_verdict
from endotsr.clips.effects.seen import depth_verdict, highlight_verdict, occluder_verdict
from endotsr.clips.effects.topology import topology_verdict
from endotsr.clips.effects.tracks import make_tracks, without_frames
from endotsr.clips.effects.verdict import EffectVerdict, verdict_record
from endotsr.clips.effects.views import view_verdict
from endotsr.clips.sequences.sequence import Sequence
from endotsr.errors import InputError

EFFECTS = (
    "motion", "photometric", "highlights", "occluders", "camera motion", "view change", "depth quality",
    "topology change", "smoke", "blur",
)  # fmt: skip


class Inspection(NamedTuple):
    """All results for a clip."""

    clip: ReducedFrames
    noise: Noise
    verdicts: dict[str, EffectVerdict]  # by effect, in the order of `EFFECTS`
    lines: list[Line]  # motion rates
    frame_rate: float | None  # frames per second; None: unknown

    def per_minute(self, cycles: float) -> float | None:
        """Cycles per minute of a rate in cycles per sequence; None without a frame rate."""
        return None if self.frame_rate is None else 60.0 * cycles * self.frame_rate / self.clip.frames


def inspect_sequence(sequence: Sequence, frame_rate: float | None = None) -> Inspection:
    """Test the training frames of a sequence for every effect.

    frame_rate   frames per second; default: from the sequence. With a frame rate, rates are also given per minute

    Raises: InputError for a frame rate that is not positive and finite.
    Equal sequences give equal verdicts: the simulated null has a fixed seed.
    """
    if frame_rate is not None and not 0.0 < frame_rate < float("inf"):
        raise InputError(f"frame rate {frame_rate:g} is not allowed; use a number > 0, frames per second")
    frame_rate = sequence.frame_rate if frame_rate is None else frame_rate
    clip = reduced_frames(sequence)
    noise = estimate_noise(sequence, clip)
    smoke, blur = clarity_verdicts(sequence, clip, noise)
    clear = clear_frames(clip, smoke, blur) & clip.masks.any(axis=(1, 2))
    clip = with_clear_reference(clip, clear)
    tracks = make_tracks(clip, noise)
    motion, lines = motion_verdict(sequence, clip, without_frames(tracks, ~clear), noise)
    camera = camera_verdict(sequence, clip)
    found = [
        motion, camera, view_verdict(sequence, clip), occluder_verdict(sequence, clip),
        photometric_verdict(clip, tracks, noise, motion.present or camera.present),
        highlight_verdict(sequence, clip), depth_verdict(sequence, clip),
        topology_verdict(clip, clear, noise, camera.present), smoke, blur,
    ]  # fmt: skip
    by_name = {verdict.effect: verdict for verdict in found}
    return Inspection(clip, noise, {name: by_name[name] for name in EFFECTS}, lines, frame_rate)


def inspection_record(inspection: Inspection) -> dict[str, Any]:
    """The inspection as JSON-able data."""
    noise = inspection.noise
    rates = [line._asdict() | {"per_minute": inspection.per_minute(line.cycles)} for line in inspection.lines]
    return {
        "frames": inspection.clip.frames,
        "training_frames": inspection.clip.count,
        "working_size": list(inspection.clip.images.shape[:1:-1]),
        "frame_rate": inspection.frame_rate,
        "noise": {"level": noise.level, "by_channel": noise.full.tolist(), "source": noise.source},
        "verdicts": {name: verdict_record(verdict) for name, verdict in inspection.verdicts.items()},
        "rates": rates,
    }
