"""`endotsr check`: all faults of a sequence, in one pass."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import parse
from endotsr.config import PAPER, Config
from endotsr.errors import InputError
from endotsr.untrusted.names import counted

SHORT = ("sequence.scale", "sequence.frames", "sequence.masks", "training.threads")


@dataclass
class CheckOptions:
    """Check a sequence before training: every finding with file, frame, reason and remedy.

    Exit code 0: the sequence is ready for training; 1: it is refused.
    """

    sequence: Annotated[str, Option("SEQUENCE", positional=True)] = ""
    """sequence folder, in the common format or in the layout of EndoNeRF"""
    json: Annotated[Path | None, Option("FILE.json", written=True)] = None
    """write the findings to this file"""
    html: Annotated[Path | None, Option("FILE.html", written=True)] = None
    """write a page with the findings and pictures to this file"""
    settings: Annotated[Config, Option(flat=True, short=SHORT)] = PAPER


def run(words: list[str]) -> int:
    """The command."""
    base, _ = base_settings(words)
    options = parse(CheckOptions, words, "check", CheckOptions(settings=base))
    if not options.sequence:
        raise InputError("check: SEQUENCE is missing: a sequence folder")
    from endotsr.cli.parts.waiting import in_words
    from endotsr.clips.sequences.checks.check import check_sequence
    from endotsr.clips.sequences.forecast.seconds import Speed, vector_factor
    from endotsr.method.kernels.threads import use_threads
    from endotsr.results.evaluation.lpips import lpips_file
    from endotsr.results.report.check_page import check_page
    from endotsr.training.runs.files import write_json
    from endotsr.training.runs.speed import ASSUMED, known_speed
    from endotsr.untrusted.writing import replace_text

    threads = use_threads(options.settings.training.threads)
    speed = known_speed(threads)
    of_machine = Speed(speed.unit, threads, lpips_file() is not None, vector_factor(), speed.beside)
    checked = check_sequence(Path(options.sequence), options.settings, of_machine)
    for finding in checked.findings:
        print(f"{finding.level}: {finding.code}: {finding.line}")
    facts = checked.facts
    if cost := facts.get("cost"):
        whole, iterations = in_words(60 * cost["command_minutes"]), in_words(60 * cost["minutes"])
        fraction = "" if iterations == whole else f", {iterations} of them for the iterations,"
        print(
            f"{counted(facts.get('frames', 0), 'frame')} of {facts.get('width')}x{facts.get('height')}:"
            f" training needs about {cost['total_bytes'] / 1e9:.1f} GB and {whole} with the evaluation{fraction}"
            f" and ends with about {cost['gaussians']} Gaussians" + (f" ({ASSUMED})" if speed.source == ASSUMED else "")
        )
    print(f"{options.sequence}: {'refused' if checked.refused else 'ready for training'}")
    if options.json is not None:
        findings = [finding._asdict() for finding in checked.findings]
        write_json(options.json, {"source": checked.source, "findings": findings, "facts": facts})
    if options.html is not None:
        replace_text(options.html, check_page(checked))
    return 1 if checked.refused else 0
