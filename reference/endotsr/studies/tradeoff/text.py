"""The results in `tradeoff.json` as table rows, and quantities as text."""

from endotsr.studies.tradeoff.results import DatedMeasurement, Measurement, Point
from endotsr.untrusted.names import counted

LEVELS = 255.0  # levels of an 8-bit picture


def levels(error: float) -> str:
    """An error in 8-bit levels: two digits, or whole levels."""
    found = error * LEVELS
    return f"{found:.0f}/255" if found >= 99.5 else f"{found:.2g}/255"


def milliseconds(seconds: float) -> str:
    """A time in milliseconds as text, with three digits."""
    digits = f"{seconds * 1e3:.3g}"
    return f"{float(digits):.0f} ms" if "e+" in digits else f"{digits} ms"


def small(number: float) -> str:
    """A cutoff or a stop: 1/255, 1/1024, 1e-4."""
    return f"1/{round(1 / number)}" if number > 5e-4 else f"{number:.0e}".replace("e-0", "e-")


def front_rows(result: Measurement) -> list[list[str]]:
    """The undominated settings, fastest first: name, times, visits, errors."""
    by_name = {p["name"]: p for p in result["points"]}
    return [_row(by_name[name]) for name in result["fronts"]["forward"]]


COLUMNS = ("Setting", "frame", "with reverse", "visits", "largest error", "RMS", "worst gradient block")


def _row(point: Point) -> list[str]:
    error = point["error"]
    return [
        point["name"],
        milliseconds(point["forward"]["median"]),
        milliseconds(point["both"]["median"]),
        f"{point['visits']:,}".replace(",", " "),
        levels(error["max"]),
        levels(error["rms"]),
        f"{error['gradient']:.2g}",
    ]


def made(result: DatedMeasurement) -> str:
    """A sentence with date, machine, version and scene of the measurement."""
    processor, cores = (result["machine"].get(key) for key in ("processor", "cores"))
    about, threads = result["scene"], counted(result["threads"], "thread")
    return (
        f"Measured {result['date'][:10]} on {threads} of {processor} ({cores} cores), "
        f"endotsr {result['versions']['endotsr']}; medians of {result['repeats']} warm runs. Scene: {about['about']}, "
        f"{about['gaussians']} Gaussians at {about['width']}x{about['height']}."
    )
