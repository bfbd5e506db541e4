"""The findings of `endotsr check` as one self-contained page."""

from endotsr.clips.sequences.checks.check import Checked
from endotsr.clips.sequences.checks.kinds import KINDS
from endotsr.results.report import parts

TITLES = {"refusal": "Refusals: training is not possible", "warning": "Warnings", "note": "Notes"}


def check_page(checked: Checked) -> str:
    """The page as text: findings by level with remedies, and example pictures."""
    counts = {level: sum(f.level == level for f in checked.findings) for level in TITLES}
    verdict = "is ready for training" if not checked.refused else "is refused"
    lead = (
        f"{counts['refusal']} refusals, {counts['warning']} warnings, {counts['note']} notes;"
        f" {len(KINDS)} kinds of findings were checked"
    )
    body = [
        f'<p class="eyebrow">endotsr check</p><h1>{parts.text(checked.source)} {verdict}</h1><p class="lead">{lead}</p>'
    ]
    body += [parts.section(title, _table(checked, level)) for level, title in TITLES.items() if counts[level]]
    shown = "".join(parts.figure(caption, parts.image(picture, caption)) for caption, picture in checked.pictures)
    body.append(parts.section("Pictures", f'<div class="charts">{shown}</div>' if shown else ""))
    facts = {key: value for key, value in checked.facts.items() if not isinstance(value, dict)}
    facts |= {key.replace("_", " "): round(value, 1) for key, value in checked.facts.get("cost", {}).items()}
    rows = parts.definitions((parts.text(key), parts.cell(value)) for key, value in facts.items())
    body.append(parts.section("Size and estimated cost", rows))
    return parts.page(f"endotsr check: {checked.source}", "\n".join(part for part in body if part))


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
