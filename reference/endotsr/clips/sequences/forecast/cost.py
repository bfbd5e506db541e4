"""The cost of a training in memory, disk and time, estimated from the settings and the size of the sequence."""

from typing import NamedTuple

from endotsr.clips.sequences.forecast.seconds import ASSUMED, Frames, Speed, TimedCommand, estimated_seconds
from endotsr.clips.sequences.forecast.work import PIXELS, gaussians_at_end
from endotsr.clips.sequences.frame_store import PIXEL_BYTES
from endotsr.config import Config
from endotsr.method.kernels.memory import memory_limit

TARGET_BYTES = 0.17  # per pixel, kept by the losses for a training frame
BETWEEN_BYTES = 2 * 8.5  # per pixel, for two targets between neighbouring training frames
PROGRAM_BYTES, IMAGE_BYTES, GAUSSIAN_BYTES = 0.3e9, 0.3e9, 8.7e3  # the rest: program, images of 640x512, one Gaussian


class Cost(NamedTuple):
    """Estimates for one training."""

    sequence_bytes: float  # of the frames as read
    total_bytes: float  # of memory; frames in a file need none
    file_bytes: float  # of the file with the frames; 0 = in memory
    minutes: float  # of the iterations, with the targets between the frames
    command_minutes: float  # of the whole `endotsr train`, without compilation
    gaussians: int  # at the end


def estimated_cost(frames: Frames, width: int, height: int, config: Config, speed: Speed = ASSUMED) -> Cost:
    """The cost of a training with these settings, of fixed length, on frames of this size, read at `sequence.scale`."""
    count, scale, between = frames.total, config.sequence.scale, config.training.bridge_fraction > 0
    limit, read = memory_limit(config.sequence.memory), count * width * height * PIXEL_BYTES
    pixels = width * height * scale**2
    gaussians = gaussians_at_end(config, pixels)
    in_file = read > limit / 2
    kept = min(count * pixels * TARGET_BYTES, limit / 4)
    kept += min(count * pixels * BETWEEN_BYTES, limit / 4) if between else 0.0
    small = pixels * count * PIXEL_BYTES if scale != 1.0 else 0.0  # both sizes exist during scaling
    working = PROGRAM_BYTES + IMAGE_BYTES * pixels / PIXELS + GAUSSIAN_BYTES * gaussians
    total = (0 if in_file else read) + min(small, limit / 2) + kept + working
    plan = TimedCommand(config, frames, round(pixels), speed.threads, speed.perceived, speed.vectors, speed.beside)
    found = estimated_seconds(plan, speed.unit)
    return Cost(read, total, read if in_file else 0.0, found.training / 60, sum(found) / 60, gaussians)
