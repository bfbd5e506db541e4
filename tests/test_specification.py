"""The specification and the code agree: labels, settings and presets."""

import re
from pathlib import Path

import msgspec
import pytest
from pages.book import settings

from endotsr.config import DEMO, PAPER, PRESETS, SHARP, Config, with_iterations
from endotsr.method.splatting import settings as raster

ROOT = Path(__file__).parent.parent
SPECIFICATION = ROOT / "docs" / "specification"
PACKAGE = ROOT / "reference" / "endotsr"

PAPER_LABELS = ["1", "1b", *"234567"]
BASE_LABELS = [f"B{k}" for k in range(1, 14)]
METRIC_LABELS = ["M1", "M2", "M3"]
LABELS = [*PAPER_LABELS, *BASE_LABELS, *METRIC_LABELS]

# "eq. (B5)", "equation 6 and B10-B12", "specification B5", "Eq. (1)-(2)", "equations (1), (1b) and (2)"; "(B6)" alone
NAME = r"(?:[BM]\d+[a-z]?|\d+[a-z]?)\b"
NUMBER = rf"(?:\({NAME}\)|{NAME})"
CITATION = re.compile(
    rf"\b(?:[Ee]q(?:uation)?s?\.?|[Ss]pecification,?)\s*({NUMBER}(?:(?:\s*(?:,|-|to|and|or)\s*)+{NUMBER})*)"
)
ALONE = re.compile(r"\(([BM]\d+[a-z]?)\)")


def specification_text() -> str:
    return "\n".join(page.read_text(encoding="utf-8") for page in sorted(SPECIFICATION.glob("*.md")))


def labels_in(text: str) -> list[str]:
    return re.findall(r"^\$\$ \(eq-([\w-]+)\)$", text, flags=re.MULTILINE)


def cited_numbers(source: str) -> set[str]:
    spans = {name for span in CITATION.findall(source) for name in re.findall(NAME, span)}
    return spans | set(ALONE.findall(source))


def table_after(page: str, heading: str) -> list[list[str]]:
    """Rows of the first table under `heading`, header first, back quotes removed."""
    text = (SPECIFICATION / page).read_text(encoding="utf-8")
    body = text.split(f"\n## {heading}\n", 1)[1]
    lines = []
    for line in body.splitlines():
        if line.startswith("|"):
            lines.append(line)
        elif lines:
            break
    cells = [[cell.strip().strip("`") for cell in line.strip("|").split("|")] for line in lines]
    return [cells[0], *cells[2:]]


def settings_by_key(config: Config) -> dict[str, object]:
    flat: dict[str, object] = {}
    for key, value in msgspec.to_builtins(config).items():
        flat |= {f"{key}.{k}": v for k, v in value.items()} if isinstance(value, dict) else {key: value}
    return flat


def documented_value(text: str) -> object:
    """A cell of a settings table as a Python value."""
    if re.fullmatch(r"-?[\d.]+(?:e-?\d+)?/[\d.]+", text):
        over, under = text.split("/")
        return float(over) / float(under)
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return msgspec.json.decode(text)
    except msgspec.DecodeError:
        return text


def test_every_label_has_exactly_one_display():
    found = labels_in(specification_text())
    assert len(found) == len(set(found)), "a label is used twice"
    missing = {label.lower() for label in LABELS} - set(found)
    assert not missing, f"no display for {sorted(missing)}"


def test_citations_are_recognised():
    text = "eq. (1)-(2), equation (B5), Equations (1b), (3) and (M1); specification B2-B4; equation 6, B10-B12; (B9)"
    assert cited_numbers(text) == {"1", "2", "B5", "1b", "3", "M1", "B2", "B4", "6", "B10", "B12", "B9"}
    assert cited_numbers("a shape (3), a frequency (8), the specification of 2 arrays, N = 5") == set()


def test_every_equation_cited_by_the_code_exists():
    found = set(labels_in(specification_text()))
    for file in sorted(PACKAGE.rglob("*.py")):
        for number in cited_numbers(file.read_text(encoding="utf-8")):
            assert number.lower() in found, f"{file.relative_to(ROOT)} cites equation ({number}), which no page defines"


def test_every_page_links_to_labels_that_exist():
    text = specification_text()
    missing = set(re.findall(r"\{eq\}`eq-([\w-]+)`", text)) - set(labels_in(text))
    assert not missing, f"linked but not defined: {sorted(missing)}"


def test_every_setting_is_documented_with_its_default():
    text = settings.PAGE.read_text(encoding="utf-8")
    assert text == settings.completed(text), "run: python docs/make.py book.settings"


def test_a_new_setting_gets_the_page_of_its_term_before_that_of_the_objective():
    assert settings.equation_of("loss.smoothness_weight") == "{eq}`eq-b9`"  # both pages name it
    assert settings.equation_of("training.no_such_key") == "-"


def test_no_setting_is_documented_that_does_not_exist():
    known = set(settings_by_key(PAPER))
    sections = {key.split(".")[0] for key in known if "." in key}
    named = set(re.findall(rf"`((?:{'|'.join(sections)})\.[a-z_0-9]+)`", specification_text()))
    assert named <= known, f"unknown keys in the specification: {sorted(named - known)}"


def test_every_setting_of_an_equation_is_named_on_a_page_of_its_own():
    """Beyond the table: a reader of the equation finds the key that sets it."""
    pages = "\n".join(
        page.read_text(encoding="utf-8")
        for page in SPECIFICATION.glob("*.md")
        if page.name not in ("settings.md", "rulings.md")
    )
    sections = ("model", "raster", "loss", "optimiser", "density", "initialisation", "training")
    keys = [key for key in settings_by_key(PAPER) if key.split(".")[0] in sections]
    missing = [key for key in keys if f"`{key}`" not in pages and f"\\texttt{{{key}}}" not in pages]
    assert not missing, f"named on no equation page: {missing}"


def test_raster_presets_equal_the_table():
    header, *rows = table_after("rulings.md", "Presets of the rasteriser")
    assert set(header[1:]) == set(raster.PRESETS)
    fields = [f for f in raster.RasterSettings._fields if f != "deviations"]
    fields += [f"deviations.{f}" for f in raster.LegacyDeviations._fields]
    assert [row[0] for row in rows] == fields
    for row in rows:
        for name, text in zip(header[1:], row[1:], strict=True):
            value: object = raster.PRESETS[name]
            for part in row[0].split("."):
                value = getattr(value, part)
            assert documented_value(text) == value, f"{name}.{row[0]}: documented {text}, is {value}"


def test_run_presets_equal_the_table():
    header, *rows = table_after("rulings.md", "Presets of a run")
    assert header[1:] == ["paper", "sharp"]
    length = SHARP.training.iterations
    paper, sharp = settings_by_key(with_iterations(PAPER, length)), settings_by_key(SHARP)
    differing = {key for key in paper if paper[key] != sharp[key]} - {"preset"}
    assert {row[0] for row in rows} == differing | {"training.iterations"}
    for key, *values in rows:
        for name, text in zip(header[1:], values, strict=True):
            assert documented_value(text) == settings_by_key(PRESETS[name])[key]


OF_SHARP = {  # what differs from `sharp` of the same length
    "quick": (1600, {
        "preset": "quick", "density.growth": "budget", "density.maximum": 22_000,
        "initialisation.first_frame_points": 14_000, "initialisation.other_frame_points": 2000,
        "training.coarse_start": True, "training.visits_per_frame": 29,
    }),
    "demo": (1500, {
        "preset": "demo", "density.gradient_threshold": 7e-4,
        "optimiser.position": 1.6e-3, "optimiser.deformation": 1.6e-3, "optimiser.harmonics_base": 2.5e-3,
        "optimiser.scale": 0.005, "optimiser.rotation": 0.001,
        "initialisation.first_frame_points": 6000, "initialisation.other_frame_points": 1500,
    }),
}  # fmt: skip


@pytest.mark.parametrize("name", OF_SHARP)
def test_a_short_preset_is_sharp_with_another_length_and_size(name):
    length, changes = OF_SHARP[name]
    stretched, found = settings_by_key(with_iterations(SHARP, length)), settings_by_key({**PRESETS, "demo": DEMO}[name])
    assert {key: found[key] for key in found if found[key] != stretched[key]} == changes
