"""The user's choice of times: explicit times, times of frames, or evenly spaced times.

In: the choice and the record of the sequence (sequence.json). Out: times, each with the nearest frame and a name.
"""

from typing import Literal, NamedTuple

from endotsr.clips.sequences.record import SequenceRecord, nearest_frame
from endotsr.errors import InputError


class Times(NamedTuple):
    """A choice of times: at most one of the three; none = the default of a command."""

    times: tuple[float, ...] = ()  # normalised, in [0, 1]
    frames: Literal["test", "train", "all"] | None = None
    count: int | None = None  # evenly spaced over [0, 1], both ends included; 1 = time 0

    @property
    def chosen(self) -> bool:
        """Whether any of the three is given."""
        return bool(self.times) or self.frames is not None or self.count is not None


def chosen_times(
    command: str, request: Times, record: SequenceRecord, default: str = "test"
) -> list[tuple[float, int, str, bool]]:
    """Time, nearest frame, name, and whether the time is exactly that of the frame.

    command   for messages
    default   frames to use if nothing is chosen

    Raises: InputError for a time outside [0, 1], a count below 1, more than one kind of choice, or frames of which the
            sequence has none.
    """
    if sum([bool(request.times), request.frames is not None, request.count is not None]) > 1:
        raise InputError(f"{command}: give one of --times, --frames and --count")
    if request.times or request.count is not None:
        times = list(request.times) or _even(command, request.count or 0)
        for time in times:
            if not 0.0 <= time <= 1.0:
                raise InputError(f"{command}: --times {time:g} is not allowed; use times in [0, 1]")
        known = record.times
        nearest = [nearest_frame(known, t) for t in times]
        return [(t, i, f"{k:05d}", known[i] == t) for k, (t, i) in enumerate(zip(times, nearest))]
    every = range(record.count)
    chosen = {"test": record.test_index, "train": record.train_index, "all": every}[request.frames or default]
    if not chosen:
        raise InputError(f"{command}: no frame is held out; use --frames train or all, --times, --count")
    return [(record.times[i], i, record.names[i], True) for i in chosen]


def _even(command: str, count: int) -> list[float]:
    if count < 1:
        raise InputError(f"{command}: --count {count} is not allowed; use an integer >= 1")
    return [i / max(count - 1, 1) for i in range(count)]
