"""Write the generated parts of docs/paper.md: the method sentence by sentence, and the systems.

Every sentence is in our own words. Its functions, checks and notebooks come from the map of the equations, its ruling
is a row of docs/specification/rulings.md, and its verdict a row of docs/claims.md. A name that does not exist is an
error.
"""

# A record of a page is complete, or the KeyError says what it lacks.
# pyright: reportTypedDictNotRequiredAccess=false

import math
import re
import sys
from decimal import ROUND_HALF_UP, Decimal
from typing import Any, NamedTuple

from pages.claims.estimates import runs_of
from pages.claims.verdicts import CLIPS, HEADS, implied_base
from pages.store.commands import loaded
from pages.store.intervals import student
from pages.store.program import DOCS, RESULTS, Program
from pages.store.published import BY_NAME, PUBLISHED, SEVEN_OTHERS, SURGICALGS

sys.path.append(str(DOCS / "_extensions"))

from book_map import Equation, equations  # pyright: ignore[reportMissingImports]
from package_names import definitions  # pyright: ignore[reportMissingImports]

from endotsr.errors import InputError
from endotsr.results.report.tables import markdown

CLAIMS, RULINGS = DOCS / "claims.md", DOCS / "specification" / "rulings.md"
VERDICT = HEADS.index("verdict")  # column of the tables of verdicts


class Sentence(NamedTuple):
    """One statement of the method."""

    says: str
    label: str  # of the equation
    rulings: tuple[str, ...] = ()  # first cells of rows of the rulings
    verdict: str = ""  # start of the first cell of a row of the verdicts


SECTIONS: dict[str, tuple[Sentence, ...]] = {
    "The scene": (
        Sentence("Gaussians in 3-D have a centre, a rotation, three axes, an opacity and harmonics of colour.", "b2",
                 ("quaternion", "harmonics")),
        Sentence("The first Gaussians are pixels of the training views, lifted by their depth.", "b12",
                 ("initial points", "depth zeros")),
        Sentence("Bases over time deform centre, rotation and axes of each Gaussian.", "b1",
                 ("FDM basis", "FDM composition", "initial FDM width")),
        Sentence("The Gaussians are projected and blended from front to back; depth is blended like colour.", "b5",
                 ("off-axis clamp of $J$", "support", "depth image", "depth gradient")),
    ),
    "Temporal dictionary": (
        Sentence("Both residuals share sines and cosines of a few log-spaced frequencies.", "1",
                 ("frequencies", "atom order")),
        Sentence("For colour, each atom is centred and scaled to RMS 1 over the training stamps.", "1b",
                 ("atom statistics",)),
    ),
    "A: appearance": (
        Sentence("The degree-0 harmonic changes by a hyperbolic tangent of a sum of atoms, at most by a bound.", "2",
                 ("colour residual",),
                 "Temporal appearance improves on spectral motion alone: PSNR"),
        Sentence("Appearance is the largest of the three gains.", "2", (),
                 "Temporal appearance is the largest of the three steps: PSNR"),
    ),
    "S: spectral motion": (
        Sentence("A sum of raw atoms translates each Gaussian, in addition to the deformation.", "3",
                 ("atoms of the motion residual",), "Spectral motion improves on the base: PSNR"),
        Sentence("A Matérn-5/2 spectrum weights a quadratic penalty on the coefficients.", "4", ("Matérn weights",)),
        Sentence("At a fixed representation and count the prior changes PSNR by +0.005 and -0.002 dB in one seed.", "4",
                 (), "At a fixed representation the Matérn prior"),
    ),
    "L: Laplacian detail": (
        Sentence("Three bands of a Laplacian pyramid of render and frame are compared by L1.", "5",
                 ("filter of the Laplacian pyramid", "up-sampling of the Laplacian pyramid",
                  "empty level of the Laplacian pyramid"),
                 "Laplacian detail improves on both residuals: PSNR"),
        Sentence("The mask propagates through the pyramid, so that no excluded pixel enters a band value.", "5",
                 ("mask of the Laplacian pyramid",)),
        Sentence("The weight of L makes its gradient a given fraction of the photometric one.", "7",
                 ("calibration", "degenerate calibration")),
    ),
    "Training": (
        Sentence("The photometric loss combines masked L1 and masked D-SSIM.", "b7",
                 ("photometric loss", "mean of L1", "SSIM")),
        Sentence("Rendered depth, divided by its maximum, is compared with the normalised prior.", "b8",
                 ("depth loss", "gradient of the max")),
        Sentence("Depth is smooth on tissue; total variation is small under instruments.", "b9", ("smoothness",)),
        Sentence("All terms are added; A and S begin at iteration 3000, L ramps up from 1000 to 2500.", "6",
                 ("Laplacian weight", "residual activation", "view sampling")),
        Sentence("Adam steps all parameters; the rates of A and S are derived from that of the deformation.", "b10",
                 ("residual schedule", "Adam on density iterations")),
        Sentence("Gaussians with large screen gradients are cloned or split; transparent ones are removed.", "b11",
                 ("density extent", "children")),
    ),
    "Results": (
        Sentence("Every eighth frame is held out.", "m1", ("split", "metrics")),
        Sentence("PSNR: pulling 39.34 dB, cutting 40.96 dB; both images zeroed where the mask excludes.", "m1",
                 ("metrics", "mask folder of the metrics"), "Level: PSNR"),
        Sentence("SSIM: pulling 0.967, cutting 0.980.", "m2", ("metrics",), "Level: SSIM"),
        Sentence("LPIPS: pulling 0.035, cutting 0.019; if its input is in [0, 1]", "m3", ("metrics",),
                 "Level: LPIPS, input in [0, 1]"),
        Sentence("The same, if its input is in [-1, 1]", "m3", ("metrics",), "Level: LPIPS, input in [-1, 1]"),
        Sentence("SSIM on tissue improves with A.", "2", (),
                 "Temporal appearance improves on spectral motion alone: SSIM"),
        Sentence("SSIM on tissue improves with L.", "5", (), "Laplacian detail improves on both residuals: SSIM"),
        Sentence("LPIPS improves with A; if its input is in [0, 1]", "2", (),
                 "Temporal appearance improves on spectral motion alone: LPIPS, input in [0, 1]"),
        Sentence("With a fixed number of Gaussians, appearance and detail improve on motion alone.", "6", (),
                 "With a fixed number of Gaussians, appearance and detail improve on motion alone: PSNR"),
        Sentence("Over SurgicalGS with matched input PSNR gains 0.31 to 0.66 dB (medians over seeds, by sequence).",
                 "6", (), "PSNR, over SurgicalGS with matched input (our base)"),
        Sentence("LPIPS falls by 0.0035 to 0.0096; if its input is in [0, 1]",
                 "6", (), "LPIPS, input in [0, 1], over SurgicalGS with matched input (our base)"),
        Sentence("PSNR and LPIPS improve in every seed.", "6", (), "PSNR and LPIPS improve in every seed"),
    ),
}  # fmt: skip


def method() -> str:
    """A heading and a table for each section."""
    rows = {row.label: row for row in equations()}
    heads = ("In our words", "Equation", "Function", "Definition", "Check", "Notebook", "Ruling", "Verdict")
    made = []
    for section, sentences in SECTIONS.items():
        cells = [[s.says, *links(rows[s.label]), rulings(s.rulings), verdict(s.verdict)] for s in sentences]
        made.append(f"### {section}\n\n{markdown(heads, cells)}")
    return "\n\n".join(made)


def links(row: Equation) -> list[str]:
    """Equation, compiled functions, their definitions, gradient check and notebook."""
    functions = [name for name in row.functions if name.rpartition(".")[2] != "calibrate_on"]
    texts = [text for name in functions if (text := definition_of(name))]
    checks = [f"{{ref}}`{row.pairs[0].name} <check-{row.pairs[0].name}>`"] if row.pairs else ["none"]
    chapters = [f"{{doc}}`{int(name[:2])} </notebooks/{name}>`" for name in row.notebooks]
    shown = [f"{{eq}}`eq-{row.label}`", ", ".join(link(name) for name in functions)]
    return [*shown, ", ".join(link(text, "text") for text in texts) or "none", *checks, ", ".join(chapters) or "none"]


def link(dotted: str, words: str = "") -> str:
    """Raises: InputError for a function that does not exist."""
    if dotted not in definitions():
        raise InputError(f"docs/pages/claims/paper.py: {dotted} is not a public function")
    return f"{{py:obj}}`{words or dotted.rpartition('.')[2]} <{dotted}>`"


def definition_of(function: str) -> str:
    """The function of the same name in `endotsr.definition`, or ""."""
    name = function.rpartition(".")[2]
    found = [d for d in definitions() if d.startswith("endotsr.definition.") and d.rpartition(".")[2] == name]
    return found[0] if found else ""


def rulings(names: tuple[str, ...]) -> str:
    """Questions and answers, from the tables of the rulings. Raises: InputError for a missing question."""
    known = dict(re.findall(r"^\| ([^|]+) \| ([^|]+) \|", RULINGS.read_text(encoding="utf-8"), re.MULTILINE))
    if missing := [name for name in names if name not in known]:
        raise InputError(f"docs/specification/rulings.md: no row: {', '.join(missing)}")
    return ", ".join(f"{{doc}}`{re.sub('[$]', '', name)} </specification/rulings>`" for name in names) or "-"


def verdict(start: str) -> str:
    """The verdicts of the claim with this start on each clip, from the page of claims.

    Raises: InputError if there is none.
    """
    if not start:
        return "-"
    found = {clip: word for clip in CLIPS if (word := verdict_on(clip, start))}
    if not found:
        raise InputError(f"docs/claims.md: no verdict on '{start}'")
    return ", ".join(f"{{ref}}`{clip}: {word.split(':')[0]} <verdicts-{clip}>`" for clip, word in found.items())


def verdict_on(clip: str, start: str) -> str:
    """The verdict on one clip, or "" if the clip is not measured."""
    mark = f"claims:verdicts_{clip}"
    table = CLAIMS.read_text(encoding="utf-8").partition(f"<!-- {mark}:start -->")[2].partition("<!--")[0]
    rows = [line.strip("| ").split(" | ") for line in table.splitlines()]
    return next((row[VERDICT] for row in rows if row[0].startswith(start)), "")


def by_name() -> str:
    """Printed values of systems by name, the highest mean first; what a paper does not give is a dash."""
    cell = lambda value: "-" if math.isnan(value) else f"{value:.2f}"
    printed = lambda row: halved(row.pulling, row.cutting) if math.isnan(row.mean) else str(row.mean)
    mean = lambda row: (row.pulling + row.cutting) / 2 if math.isnan(row.mean) else row.mean
    rows = sorted(BY_NAME, key=lambda row: -mean(row))
    heads = ("System", "Pulling, dB", "Cutting, dB", "Mean, dB", "Printed in (arXiv)")
    return markdown(heads, [[r.system, cell(r.pulling), cell(r.cutting), printed(r), r.source] for r in rows])


def halved(first: float, second: float) -> str:
    """The mean of two values with two decimals, a half rounded up, as in decimal numbers."""
    return str(((Decimal(f"{first:.2f}") + Decimal(f"{second:.2f}")) / 2).quantize(Decimal("0.01"), ROUND_HALF_UP))


def systems() -> str:
    """PSNR of the whole image on pulling, every eighth frame held out: published, and measured here."""
    ablation = loaded(RESULTS / "ablation_pulling.json")
    recorded = loaded(RESULTS / "pulling_paper_seed0.json")["baselines"]
    given = lambda name: f"{recorded[name]['mean']['psnr_full']:.2f}"
    low, high = implied_base("pulling")
    base = f"configuration `base`: matched input, no A, S, L; the gain of the paper implies {low:.2f} to {high:.2f} dB"
    rows = [
        ["SurgicalGS", f"{SURGICALGS:.2f}", level(ablation, "base"), base],
        ["Endo-TSR", f"{PUBLISHED['pulling']['psnr_full']:.2f}", level(ablation, "A+S+L"), "preset `paper`"],
        *(
            [f"other system {k} of its table", f"{value:.2f}", "-", "not trained here"]
            for k, value in enumerate(SEVEN_OTHERS, 1)
        ),
        ["copy of the nearest training frame", "-", given("nearest_frame"), "no model"],
        ["blend of the two neighbours", "-", given("two_neighbours"), "no model"],
        ["optical-flow interpolation (DIS)", "-", given("flow_interpolation"), "no model"],
    ]
    return markdown(("System", "Published, dB", "Here, dB", "State here"), rows)


def level(ablation: dict[str, Any], configuration: str) -> str:
    """Mean and 95 % interval (Student) of a configuration of the ablation over its seeds."""
    values = list(runs_of(ablation, configuration, "psnr_full").values())
    if not values:
        return "not measured yet"
    mean, limits = student(values)
    return f"{mean:.2f}" if limits is None else f"{mean:.2f} ({limits[0]:.2f} to {limits[1]:.2f})"


PROGRAM = Program(__name__, "paper.md", {"method": method, "systems": systems, "by_name": by_name})
