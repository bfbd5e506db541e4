"""Films: a series of pictures as one mp4, webm or gif file, written atomically.

In: pictures of one size. Out: a file. mp4 uses H.264, or VP9 if FFmpeg has no encoder of H.264; webm uses VP9; gif has
256 colours and needs no FFmpeg.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.sequences.record import UNKNOWN_RATE
from endotsr.errors import InputError
from endotsr.results.report.figures import ByteImage
from endotsr.untrusted.marks import FILM
from endotsr.untrusted.names import choice
from endotsr.untrusted.writing import replace_file

KINDS = (".mp4", ".webm", ".gif")
GIF_COLOURS = 256
PALETTE_FRAMES = 8  # pictures that determine the palette of a gif: fewer than twice as many, or all of a short one
LOWEST, USUAL = 0.1, (1.0, 60.0)  # pictures per second
HUNDREDTHS = 100  # units of time per second in a gif


def check_film(file: Path, rate: float | None = None, slow: float | None = None) -> None:
    """Raises InputError for a wrong extension, an invalid rate or slow-down, or a missing encoder."""
    if file.suffix.lower() not in KINDS:
        raise InputError(f"{file}: not a film; use a name that ends in {choice(KINDS)}")
    if rate is not None and slow is not None:
        raise InputError("render: --rate with --slow: both set the speed of the film; use one of them")
    highest = _highest(file)
    if rate is not None and not LOWEST <= rate <= highest:
        allowed = f"{LOWEST:g} to {highest} pictures per second"
        raise InputError(f"render: --rate {rate:g} is not allowed; use {allowed}")
    if slow is not None and not 0 < slow < float("inf"):
        raise InputError(f"render: --slow {slow:g} is not allowed; use a number > 0")
    if file.suffix.lower() != ".gif":
        from endotsr.clips.formats.film_file import encoder_of

        encoder_of(file)


def film_rate(file: Path, times: list[float], duration: float, slow: float | None = None) -> float:
    """Pictures per second for a film that takes `slow` times as long as the recording.

    times      of the pictures, normalised
    duration   seconds from time 0 to time 1; 0 = unknown
    slow       default: 1, clipped to the range USUAL (of a gif, up to 50); 15 pictures per second if times or duration
               define no speed

    Raises: InputError if `slow` is given but the speed is undefined, or out of the film's range.
    """
    seconds = _seconds(times, duration)
    if seconds <= 0:
        if slow is not None:
            order = "one picture has no speed" if len(times) < 2 else "the pictures are not in order of time"
            unknown = order if duration else "the recording's frame rate is unknown"
            raise InputError(f"render: --slow {slow:g}: {unknown}; use --rate, pictures per second")
        return UNKNOWN_RATE
    own = (len(times) - 1) / seconds
    if slow is None:
        return min(max(own, USUAL[0]), min(USUAL[1], _highest(file)))
    if not LOWEST <= own / slow <= _highest(file):
        raise InputError(
            f"render: --slow {slow:g} gives {own / slow:.3g} pictures per second; use --slow from"
            f" {own / _highest(file):.3g} to {own / LOWEST:.3g} with {len(times)} pictures (--count), or --rate"
        )
    return own / slow


def played_rate(file: Path, rate: float) -> float:
    """Pictures per second at which a film plays; those of a gif last a whole number of hundredths of a second."""
    return HUNDREDTHS / _hundredths(rate) if file.suffix.lower() == ".gif" else rate


def speed_in_words(times: list[float], duration: float, rate: float) -> str:
    """The speed of a film relative to the recording, as the end of a sentence; "" if unknown."""
    seconds = _seconds(times, duration)
    return f", {rate * seconds / (len(times) - 1):.3g} times the speed of the recording" if seconds > 0 else ""


def _seconds(times: list[float], duration: float) -> float:
    """Seconds of the recording from the first picture to the last; 0 if unknown, or out of order of time."""
    ordered = all(b >= a for a, b in pairwise(times))
    return (times[-1] - times[0]) * duration if ordered else 0.0


def _highest(file: Path) -> int:
    """The highest rate of a film in this format, pictures per second."""
    return 50 if file.suffix.lower() == ".gif" else 120


def write_film(file: Path, pictures: Iterable[ByteImage], rate: float) -> int:
    """Write a film; returns the number of its pictures.

    pictures   (H, W, 3) uint8 RGB, all of one size; for mp4 and webm an odd side is padded by one pixel
    rate       pictures per second; a gif rounds the duration of a picture to 0.01 s
    Raises: InputError if there is no picture or this FFmpeg cannot encode the film.
    """
    count = 0

    def counted() -> Iterator[ByteImage]:
        nonlocal count
        for picture in pictures:
            count += 1
            yield picture

    if file.suffix.lower() == ".gif":
        replace_file(file, lambda temporary: _write_gif(temporary, counted(), rate))
    else:
        from endotsr.clips.formats.film_file import write_video

        replace_file(file, lambda temporary: write_video(temporary, map(_even, counted()), rate, comment=FILM))
    return count


def _even(picture: ByteImage) -> ByteImage:
    """The picture padded to even sides, as required by the colour format of a film."""
    rows, columns = picture.shape[0] % 2, picture.shape[1] % 2
    return np.pad(picture, ((0, rows), (0, columns), (0, 0)), mode="edge") if rows or columns else picture


def _write_gif(file: Path, pictures: Iterator[ByteImage], rate: float) -> None:
    from PIL import Image

    frames = [Image.fromarray(picture) for picture in pictures]
    if not frames:
        raise InputError(f"{file}: a film needs a picture")
    palette = _palette(frames)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG) for frame in frames]
    milliseconds = 10 * _hundredths(rate)
    frames[0].save(
        file, save_all=True, append_images=frames[1:], duration=milliseconds, loop=0, optimize=False, comment=FILM
    )


def _hundredths(rate: float) -> int:
    """Duration of a picture of a gif, hundredths of a second; browsers replace less than 2 by 10."""
    return max(2, round(HUNDREDTHS / rate))


def _palette(frames: list[Any]) -> Any:
    """One palette for the whole film, from evenly spaced pictures; a palette per picture would flicker."""
    from PIL import Image

    chosen = frames[:: max(1, len(frames) // PALETTE_FRAMES)]
    width, height = chosen[0].size
    sheet = Image.new("RGB", (width, height * len(chosen)))
    for k, frame in enumerate(chosen):
        sheet.paste(frame, (0, k * height))
    return sheet.quantize(GIF_COLOURS)
