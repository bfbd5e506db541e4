"""What a person waits for in `endotsr train`, in one line before the first iteration, also of a resumed training."""

from endotsr.clips.sequences.forecast.seconds import COMPILATION, TimedCommand, estimated_seconds
from endotsr.clips.sequences.forecast.work import Standing
from endotsr.results.report.tables import duration
from endotsr.training.runs.speed import KnownSpeed
from endotsr.untrusted.names import counted


def waiting_line(plan: TimedCommand, speed: KnownSpeed, compiled: bool, at: Standing | None = None) -> str:
    """The parts of the command after reading, with the time of each.

    speed      of this machine, with the threads of the plan
    compiled   whether the kernels are in the cache
    at         progress of a training that is resumed; None = a new one
    """
    found = estimated_seconds(plan, speed.unit, at)
    left = plan.config.training.iterations - (0 if at is None else at.iteration)
    steps = {
        "initial motion": found.start,
        "compilation, once": 0.0 if compiled else COMPILATION,
        "calibration": found.calibration,
        f"{left} iterations": found.training - found.calibration,
        "evaluation": found.evaluation,
    }
    named = ", ".join(f"{name} {duration(seconds)}" for name, seconds in steps.items() if seconds >= 1)
    whole = f"about {in_words(sum(steps.values()))} for {counted(plan.frames.total, 'frame')} ({speed.source})"
    return f"{whole}: {named}" if named else whole


def in_words(seconds: float) -> str:
    """A duration as "40 seconds", "3 minutes" or "1.5 hours"."""
    if seconds < 55:
        return counted(max(1, round(seconds)), "second")
    if seconds < 90 * 60:
        return counted(round(seconds / 60), "minute")
    return f"{seconds / 3600:.1f} hours"
