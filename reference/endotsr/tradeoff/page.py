"""The results in `tradeoff.json` as three sentences of advice, tables, and a self-contained page."""

from pathlib import Path
from typing import Any

from endotsr.report import parts as parts
from endotsr.report.figures import data_uri
from endotsr.report.tables import html_table
from endotsr.runs.files import replace_file
from endotsr.tradeoff.measure import LEVELS

PICTURES = {
    "": "Error of the image against time and against visited pairs. Grey: settings of the joint sweep. "
    "Blue: those that no other dominates. Diamonds: the presets.",
    "_dials": "Every dial varied alone: largest error of the image against the time of a frame. Grey bars: quartiles.",
    "_dials_visits": "The same against visited pairs, which do not depend on the machine.",
    "_dials_gradients": "The worst gradient block against the time of a frame with its reverse pass.",
}


def levels(error: float) -> str:
    """An error in steps of an 8-bit picture."""
    return f"{error * LEVELS:.2g}/255"


def small(number: float) -> str:
    """A cutoff or a stop: 1/255, 1/1024, 1e-4."""
    return f"1/{round(1 / number)}" if number > 5e-4 else f"{number:.0e}".replace("e-0", "e-")


def milliseconds(seconds: float) -> str:
    """A time in milliseconds as text."""
    return f"{seconds * 1e3:.3g} ms"


def advice(result: dict[str, Any]) -> list[str]:
    """Three sentences, each with the figures of this measurement."""
    by_name = {p["name"]: p for p in result["points"]}
    paper = by_name[result["presets"]["paper"]]
    chosen = eight_bit_setting(result)
    sentences = [
        f"For pictures and for training take `paper`: it errs by {levels(paper['error']['rms'])} on average and by "
        f"{levels(paper['error']['max'])} at the worst pixel{_against_noise(paper, result)}."
    ]
    if chosen is not None:
        raster = chosen["setting"]["raster"]
        sentences.append(
            f"For an image that is right to the last of 8 bits, lower the cutoff to {small(raster['alpha_cutoff'])} "
            f"and the stop to {small(raster['transmittance_stop'])}, in float32: "
            f"{chosen['visits'] / paper['visits']:.1f} times the visits of `paper`, and a largest error of "
            f"{levels(chosen['error']['max'])}."
        )
    if result["joint"]:
        sentences.append(
            f"Below a largest error of {levels(float32_floor(result))} float32 ends and float64 begins, whose error "
            f"falls with the cutoff, here at most {error_over_cutoff(result):.1f} times it; `exact` is for certifying, "
            "never for work."
        )
    return sentences


def eight_bit_setting(result: dict[str, Any]) -> dict[str, Any] | None:
    """The cheapest float32 setting of the sweep whose largest error is below half a step of 8 bit."""
    kept = [p for p in _joint(result, "float32") if p["error"]["max"] <= result["lines"]["eight_bit"]]
    return min(kept, key=lambda p: (p["visits"], p["error"]["max"]), default=None)


def error_over_cutoff(result: dict[str, Any]) -> float:
    """Largest error over the cutoff, in float64, where the cutoff decides: at the tightest stop, below it."""
    rasters = [(p["error"]["max"], p["setting"]["raster"]) for p in _joint(result, "float64")]
    ratios = [
        error / raster["alpha_cutoff"]
        for error, raster in rasters
        if raster["transmittance_stop"] <= 1e-6 and raster["alpha_cutoff"] > raster["transmittance_stop"]
    ]
    return max(ratios, default=float("nan"))


def float32_floor(result: dict[str, Any]) -> float:
    """The smallest largest error of the sweep in float32."""
    return min((p["error"]["max"] for p in _joint(result, "float32")), default=float("nan"))


def _against_noise(point: dict[str, Any], result: dict[str, Any]) -> str:
    noise = result["lines"]["sensor_noise"]
    if noise is None:
        return ""
    words = "below" if point["error"]["rms"] < noise else "above"
    return f", its average {words} the sensor noise of {levels(noise)}"


def _joint(result: dict[str, Any], precision: str) -> list[dict[str, Any]]:
    names = set(result["joint"])
    return [p for p in result["points"] if p["name"] in names and p["setting"]["precision"] == precision]


def front_rows(result: dict[str, Any], cost: str = "forward") -> list[list[str]]:
    """The settings that are not dominated, cheapest first: name, times, visits, errors."""
    by_name = {p["name"]: p for p in result["points"]}
    return [_row(by_name[name]) for name in result["fronts"][cost]]


COLUMNS = ("Setting", "frame", "with reverse", "visits", "largest error", "RMS", "worst gradient block")


def _row(point: dict[str, Any]) -> list[str]:
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


def preset_lines(result: dict[str, Any]) -> list[str]:
    """Status of each preset: on the front, or dominated by other settings and kept for a reason."""
    lines = []
    for name, verdict in result["preset_verdicts"].items():
        better, reason = verdict["dominated_by"], verdict["reason"]
        if not better:
            lines.append(f"`{name}`: nothing measured dominates it.")
        else:
            stays = f" It is kept because it {reason}." if reason else " No reason to keep it is listed."
            lines.append(f"`{name}`: dominated by {better[0]}{_more(len(better) - 1)}.{stays}")
    return lines


def _more(count: int) -> str:
    return f" and {count} more" if count else ""


def made(result: dict[str, Any]) -> str:
    """Date, machine, versions and scene of the measurement."""
    m, about = result["machine"], result["scene"]
    return (
        f"Measured {result['date'][:10]} on {result['threads']} threads of {m['processor']} ({m['cores']} cores), "
        f"endotsr {result['versions']['endotsr']}; medians of {result['repeats']} warm runs. Scene: {about['about']}, "
        f"{about['gaussians']} Gaussians at {about['width']}x{about['height']}."
    )


def certificate_line(result: dict[str, Any]) -> str:
    """The figures of the certificate."""
    c = result["reference"]["certificate"]
    return (
        f"Reference: differs from a cutoff of 1e-14 by {c['exact_against_1e14']:.1e}, from mpmath (30 digits) at "
        f"{c['pixels']} pixels by {c['pixels_against_mpmath']:.1e}; cutoffs 1e-12 and 1e-14 differ by "
        f"{c['cut_1e12_against_1e14']:.1e}. {'The certificate holds.' if c['holds'] else 'THE CERTIFICATE FAILS.'}"
    )


def plain(text: str) -> str:
    """Markdown of this module as HTML: code between backquotes."""
    pieces = parts.text(text).split("`")
    return "".join(f"<code>{piece}</code>" if i % 2 else piece for i, piece in enumerate(pieces))


def write_page(result: dict[str, Any], folder: Path, name: str = "tradeoff") -> Path:
    """`name`.html beside the pictures, which it embeds."""
    body = [
        '<p class="eyebrow">endotsr</p><h1>What accuracy costs in time</h1>',
        f'<p class="lead">{parts.text(made(result))}</p>',
        _pictures(folder, name, [""]),
        "<ol>" + "".join(f"<li>{plain(sentence)}</li>" for sentence in advice(result)) + "</ol>",
        parts.section(
            "Settings that are not dominated", html_table(COLUMNS, [[plain(c) for c in r] for r in front_rows(result)])
        ),
        parts.section("Presets", "<ul>" + "".join(f"<li>{plain(x)}</li>" for x in preset_lines(result)) + "</ul>"),
        parts.section("Every dial alone", _pictures(folder, name, [e for e in PICTURES if e])),
        parts.section("Why the reference can be trusted", f"<p>{parts.text(certificate_line(result))}</p>"),
        parts.section("Left out", _omitted(result)),
        parts.section("All settings", parts.details("Table", html_table(COLUMNS, [_row(p) for p in result["points"]]))),
    ]
    path = folder / f"{name}.html"
    content = parts.page("Accuracy against time", "\n".join(body))
    replace_file(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))
    return path


def _pictures(folder: Path, name: str, endings: list[str]) -> str:
    found = []
    for ending in endings:
        file = folder / f"{name}{ending}.png"
        if file.exists():
            source = data_uri(file.read_bytes(), "png")
            words = parts.text(PICTURES[ending])
            found.append(
                f'<figure class="panel"><img src="{source}" alt="{words}"><figcaption>{words}</figcaption></figure>'
            )
    return "".join(found)


def _omitted(result: dict[str, Any]) -> str:
    items = "".join(f"<dt>{parts.text(k)}</dt><dd>{parts.text(v)}</dd>" for k, v in result["omitted"].items())
    return f'<div class="panel"><dl>{items}</dl></div>'
