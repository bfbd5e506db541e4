"""The findings of `endotsr check` as one self-contained page."""

from endotsr.clips.sequences.checks.check import Checked
from endotsr.clips.sequences.checks.kinds import KINDS
from endotsr.results.report import parts
from endotsr.untrusted.names import counted

COST = {  # key of the cost, label, factor, unit
    "sequence_bytes": ("frames as they are read", 1e-6, "MB"),
    "total_bytes": ("memory of a training", 1e-9, "GB"),
    "file_bytes": ("file of the frames, beside the memory", 1e-6, "MB"),
    "minutes": ("iterations", 1.0, "minutes"),
    "command_minutes": ("whole command, without compilation", 1.0, "minutes"),
    "gaussians": ("Gaussians at the end", 1.0, ""),
}
TITLES = {"refusal": "Refusals: training is not possible", "warning": "Warnings", "note": "Notes"}


def check_page(checked: Checked) -> str:
    """The page as text: findings by level with remedies, and example pictures."""
    counts = {level: sum(f.level == level for f in checked.findings) for level in TITLES}
    verdict = "is ready for training" if not checked.refused else "is refused"
    found = ", ".join(counted(counts[level], level) for level in TITLES)
    lead = f"{found}. There are {len(KINDS)} kinds of findings; each is checked where the clip has the files for it."
    body = [
        f'<p class="eyebrow">endotsr check</p><h1>{parts.text(checked.source)} {verdict}</h1><p class="lead">{lead}</p>'
    ]
    body += [parts.section(title, _table(checked, level)) for level, title in TITLES.items() if counts[level]]
    shown = "".join(parts.figure(caption, parts.image(picture, caption)) for caption, picture in checked.pictures)
    body.append(parts.section("Pictures", f'<div class="charts">{shown}</div>' if shown else ""))
    facts = [(parts.text(key), parts.cell(v)) for key, v in checked.facts.items() if not isinstance(v, dict)]
    facts += [_cost_row(key, value) for key, value in checked.facts.get("cost", {}).items() if value]
    body.append(parts.section("Size and estimated cost", parts.definitions(facts)))
    return parts.page(f"endotsr check: {checked.source}", "\n".join(part for part in body if part))


def _cost_row(key: str, value: float) -> tuple[str, str]:
    """A quantity of the cost with its unit, as HTML; small ones have one decimal."""
    label, factor, unit = COST[key]
    size = value * factor
    shown = parts.number(size, 1) if unit and size < 100 else parts.cell(round(size))
    return parts.text(label), f"{shown} {unit}".strip()


def _table(checked: Checked, level: str) -> str:
    return parts.definitions(
        (
            f"<code>{parts.text(f.code)}</code>{'' if f.frame is None else f' frame {f.frame}'}",
            f"{parts.text(f.where)}: {parts.text(f.what)}. {parts.text(_begun(f.why))}."
            f" <b>{parts.text(_begun(f.remedy))}.</b>",
        )
        for f in checked.findings
        if f.level == level
    )


def _begun(words: str) -> str:
    """The words as the beginning of a sentence; a command keeps its name, and all other letters stay."""
    return words if words.startswith("endotsr ") else words[:1].upper() + words[1:]
