"""The page of a measurement, `tradeoff.html`: answers to common budgets, the diagram, and the settings on the front."""

from endotsr.errors import InputError
from endotsr.results.report import parts
from endotsr.results.report.figures import data_uri
from endotsr.results.report.style import encoded
from endotsr.results.report.tables import html_table
from endotsr.studies.tradeoff.budget import best_point, clamp_note, parse_budget, settings_words
from endotsr.studies.tradeoff.figure import main_figure
from endotsr.studies.tradeoff.results import DatedMeasurement, Measurement, Point
from endotsr.studies.tradeoff.text import COLUMNS, LEVELS, front_rows, levels, made, milliseconds

BUDGETS = ("60 fps", "30 fps", "1/255", "0.1/255")  # answered on the page; `--budget` answers any other
CAPTION = "Each point is a setting; lower is more accurate, further left is cheaper; the line is the front."
FRONT = "No measured setting is both faster and more accurate than one in this table."


def tradeoff_page(result: DatedMeasurement) -> str:
    """The page as text.

    result   a measurement, the content of `tradeoff.json`
    """
    name = result["scene"]["name"]
    body = [
        f'<p class="eyebrow">endotsr tradeoff</p><h1>Accuracy against time: {parts.text(name)}</h1>',
        f'<p class="lead">{parts.text(compared_with_paper(result))}</p>',
        parts.section("Error and cost", _diagram(result) if result["joint"] else ""),
        parts.section("The best setting within a budget", parts.definitions(_answers(result))),
        parts.section("Settings on the front", html_table(COLUMNS, _escaped(front_rows(result))), note=FRONT),
        parts.section("Measurement", f"<p>{parts.text(made(result))}</p>"),
    ]
    return parts.page(f"endotsr tradeoff: {name}", "\n".join(part for part in body if part))


def compared_with_paper(result: Measurement) -> str:
    """The error of `paper`, and what the setting costs that is never off by more than a level of 8 bits.

    The cost is that of the visited pairs, which are counted: times of equal work differ between runs.
    """
    by_name = {point["name"]: point for point in result["points"]}
    paper = by_name[result["presets"]["paper"]]
    said = f"The preset paper is off by at most {levels(paper['error']['max'])} at the worst pixel"
    kept = [by_name[name] for name in result["fronts"]["visits"] if by_name[name]["error"]["max"] <= 1 / LEVELS]
    if not kept:
        return f"{said}. No measured setting is within one level of 8 bits."
    chosen = min(kept, key=lambda point: point["visits"])
    error, times = levels(chosen["error"]["max"]), chosen["visits"] / paper["visits"]
    return f"{said}. The setting {chosen['name']} is off by at most {error}, for {times:.1f} times its visits."


def _diagram(result: Measurement) -> str:
    picture = data_uri(encoded(main_figure(result), "svg"), "svg+xml")
    return parts.figure(CAPTION, f'<img class="chart" src="{picture}" alt="Error against time and against visits">')


def _answers(result: Measurement) -> list[tuple[str, str]]:
    """For every budget the setting, its error, its time and its options; or why there is none."""
    answers = []
    for text in BUDGETS:
        try:
            point = best_point(result, parse_budget(text))
        except InputError as error:
            answers.append((parts.text(text), parts.text(str(error))))
            continue
        said = f"{point['name']}: largest error {levels(point['error']['max'])}, "
        said += f"{milliseconds(point['forward']['median'])} a frame"
        options = f"<code>{_unbroken(point)}</code>{parts.text(clamp_note(point['setting']))}"
        answers.append((parts.text(text), f"{parts.text(said)}<br>{options}"))
    return answers


def _unbroken(point: Point) -> str:
    """The options of a setting as HTML; a line ends between two of them, not within a name."""
    first, *rest = settings_words(point["setting"]).split(" --")
    return " ".join(f'<span class="whole">{parts.text(option)}</span>' for option in (first, *(f"--{o}" for o in rest)))


def _escaped(rows: list[list[str]]) -> list[list[str]]:
    """The cells as HTML; a quantity keeps its unit beside it."""
    return [[parts.text(name), *(parts.text(cell).replace(" ", "&nbsp;") for cell in cells)] for name, *cells in rows]
