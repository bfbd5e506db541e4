"""The section of the report on the additional measurements of `endotsr evaluate --measures`, a table for each."""

from endotsr.results.evaluation.measures import shown_values
from endotsr.results.evaluation.records import Measured
from endotsr.results.report import parts
from endotsr.results.report.data import ReportData
from endotsr.results.report.tables import html_table

ABOUT = {
    "depth": "Rendered depth of the held-out frames against their prior depth, whose own errors count as errors here. "
    "The other rows predict this prior from those of training frames.",
    "flicker": "Change of static tissue from frame to frame. The recorded frames change by the noise of the camera.",
    "right_view": "Renders for the right camera against the recorded right pictures, which the training does not read.",
}


def measures_html(data: ReportData) -> str:
    """The tables of the measurements; "" without any."""
    found = data.evaluation.get("measures") or {}
    return parts.section("Additional measurements", *(_table(name, entry) for name, entry in found.items()))


def _table(name: str, entry: Measured) -> str:
    title = parts.text(name.replace("_", " ").capitalize())
    if reason := entry.get("reason"):
        return f"<p><b>{title}</b> was not measured: {parts.text(reason)}.</p>"
    rows = [(row.get("label"), shown_values(entry, row)) for row in entry.get("rows", ())]
    heads = list(dict.fromkeys(value.title for _, values in rows for value in values))
    cells = []
    for label, values in rows:
        by_head = {value.title: parts.cell(value.number) for value in values}
        cells.append([parts.text(label), *(by_head.get(head, parts.ABSENT) for head in heads)])
    about = ABOUT.get(name, "")
    if left_out := entry.get("left_out"):
        about += f" Without tissue and left out: {parts.text(', '.join(left_out))}."
    return f'<p class="note">{about}</p>{html_table([name.replace("_", " ").capitalize(), *heads], cells)}'
