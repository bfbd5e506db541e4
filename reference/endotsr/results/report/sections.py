"""The report of a run as one self-contained HTML page: metrics, baselines, pictures, curves, settings.

The functions follow the order of the sections; each returns "" if its data is missing. The page embeds all pictures and
needs no script and no other file. It follows the reader's light or dark colour scheme and is readable on a phone. It
links to the viewer page, if there is one.
"""

from endotsr.results.evaluation.evaluate import all_extrapolated
from endotsr.results.report import curves, parts
from endotsr.results.report.data import DECIDING, ReportData
from endotsr.results.report.held_out import baseline_rows, extrapolated_frames, held_out, mean_of
from endotsr.results.report.held_out_pictures import pictures
from endotsr.results.report.measured import measures_html
from endotsr.results.report.misfits import misfits_html
from endotsr.results.report.run_text import (
    SHOWN,
    facts,
    interpolation_sentence,
    pose_sentence,
    training_time,
    trajectory_sentence,
)
from endotsr.results.report.tables import html_table
from endotsr.untrusted.names import counted


def headline(data: ReportData) -> str:
    """Title, a sentence comparing the model with the baselines, the headline numbers."""
    mean = mean_of(data, "held_out")
    count = len((data.evaluation.get("held_out") or {}).get("per_frame") or [])
    outside = len(extrapolated_frames(data)) if mean_of(data, "held_out", extrapolated=True) else 0
    cards = [
        (mean.get("psnr_full"), 2, "dB", "held-out PSNR, full image"),
        (mean.get("psnr_tissue"), 2, "dB", "held-out PSNR, tissue"),
        (mean.get("ssim_full"), 4, "", "SSIM, full image"),
        (mean.get("lpips"), 4, "", "LPIPS (AlexNet)"),
    ]
    boxes = [parts.card(parts.number(value, digits), unit, label) for value, digits, unit, label in cards if mean]
    reached, gaussians = curves.series(data.log, "gaussians")
    seconds = curves.series(data.log, "seconds")[1]
    if gaussians.size:
        boxes.append(parts.card(parts.cell(int(gaussians[-1])), "", f"Gaussians at iteration {reached[-1]:.0f}"))
    if run := data.evaluation.get("run"):
        boxes.append(parts.card(parts.cell(training_time(run)), "", "training time"))
    elif seconds.size:
        boxes.append(parts.card(f"{seconds.sum() / 60:.1f}", "min", "training time"))
    frames = counted(count, "held-out frame") if count else "report"
    frames += f", {outside} of them extrapolated and not in these means" if outside else ""
    return (
        f'<header><p class="eyebrow">Endo-TSR · {frames}</p><h1>{parts.text(data.title)}</h1>{_verdict(data)}'
        f'<div class="cards">{"".join(boxes)}</div></header>'
    )


ABOUT_BASELINES = (
    "A baseline combines training pictures. It provides no geometry, no other viewpoint and no depth, but can predict"
    " the pixels of a single missing frame better."
)


def _verdict(data: ReportData) -> str:
    """The tissue PSNR of the model compared with the best baseline, as a paragraph."""
    ours = mean_of(data, "held_out").get("psnr_tissue")
    means = baseline_rows(data)
    rows = [(label, value) for label, mean in means if (value := mean.get("psnr_tissue")) is not None]
    if ours is None or not rows or len(rows) < len(means):
        return ""  # a baseline without a finite PSNR may be exact
    label, best = max(rows, key=lambda row: row[1])
    kind, word = ("good", "above") if ours >= best else ("bad", "below")
    beaten = sum(ours >= value for _, value in rows)
    return (
        f'<p class="lead">On tissue the model is <b class="{kind}">{abs(ours - best):.2f} dB {word}</b> the best '
        f"baseline without a model ({parts.text(label[0].lower() + label[1:])}, {best:.2f} dB). "
        f"It is at or above {beaten} of {len(rows)} baselines. {ABOUT_BASELINES} {_interpolation(data)}</p>"
    )


def _interpolation(data: ReportData) -> str:
    """The sentence on clips where interpolation suffices, as HTML."""
    return parts.text(interpolation_sentence(data.evaluation))


def moving(data: ReportData) -> str:
    """The animation of the scene, and the link to the viewer."""
    blocks = []
    if data.preview:
        preview = data.preview
        picture = parts.moving_image(preview.moving, preview.still, preview.words, preview.width, preview.height)
        blocks.append(f'<figure class="preview">{picture}<figcaption>{parts.text(preview.words)}</figcaption></figure>')
    if data.viewer:
        link = f'<a href="{parts.text(data.viewer)}">Open the viewer</a>'
        blocks.append(f"<p>{link} to play and rotate the scene, and to show its depth and error.</p>")
    return parts.section("The scene", *blocks)


def temporal_gap(data: ReportData) -> str:
    """Means over training and held-out frames, and a chart of the held-out frames."""
    held_out, training = mean_of(data, "held_out"), mean_of(data, "training")
    table = ""
    if held_out and training:
        rows = []
        for key, label, digits, _ in DECIDING:
            inside, outside = training.get(key), held_out.get(key)
            if inside is None or outside is None:
                continue
            values = (inside, outside, inside - outside)
            rows.append([parts.text(label), *(parts.number(value, digits) for value in values)])
        table = html_table(["Mean over frames", "Training", "Held-out", "Gap"], rows)
    chart = curves.frame_chart(data.evaluation, "psnr_tissue")
    pair = f'<div class="charts">{table}{curves.chart_figure(chart)}</div>' if chart else table
    note = (
        "The temporal gap is the mean over a sample of the training frames minus the mean over the held-out frames. A "
        "large gap suggests that the prediction between training times limits the model more than its capacity does. "
        "Fitted noise, and tissue that no training frame shows, widen the gap too."
    )
    return parts.section("Temporal gap", pair, _motion(data), note=note)


def _motion(data: ReportData) -> str:
    """Sentences on the motion, compared with the cross-fade and with the truth, and on the pose correction."""
    sentences = []
    faded = mean_of(data, "cross_fade").get("psnr_tissue")
    ours = mean_of(data, "held_out").get("psnr_tissue")
    if faded is not None and ours is not None and not all_extrapolated(data.evaluation):
        word, what = ("above", "raise") if ours > faded else ("below", "do not raise")
        sentences.append(
            f"On held-out tissue the model is {abs(ours - faded):.2f} dB {word} the blend of its own renders at the "
            f"two neighbouring training times: its changes of position and colour between them {what} the PSNR."
        )
    if motion := data.evaluation.get("trajectories"):
        sentences.append(trajectory_sentence(motion))
    if change := data.evaluation.get("pose_correction"):
        sentences.append(pose_sentence(change))
    return "".join(f"<p>{parts.text(sentence)}</p>" for sentence in sentences)


def training(data: ReportData) -> str:
    """The curves of the log, and the training frames that fit badly."""
    found = curves.charts(data.log, data.evaluation)
    charts = f'<div class="charts">{"".join(map(curves.chart_figure, found))}</div>' if found else ""
    return parts.section("Training", charts, misfits_html(data.log))


def components(data: ReportData) -> str:
    """Held-out means of the model, rendered without one component at a time."""
    found, rows = data.evaluation.get("components", []), []
    for row in found:
        ours, whole = row.get("psnr_tissue"), found[0].get("psnr_tissue")
        gain = None if ours is None or whole is None or row is found[0] else ours - whole
        change = "" if gain is None else f"{gain:+.2f} dB".replace("-", "&minus;")
        rows.append([parts.text(row["label"]), *(parts.number(row.get(key), n) for key, _, n in SHOWN), change])
    note = (
        "Means over all held-out frames, rendered from the trained model with the named residual set to zero. "
        "Component L, the Laplacian loss, affects training only; to measure it, train with --model.no-laplacian."
    )
    table = html_table(["Rendered", *(label for _, label, _ in SHOWN), "Change, PSNR tissue"], rows) if rows else ""
    return parts.section("Contribution of each component", table, note=note)


def the_run(data: ReportData) -> str:
    """Facts, configuration, versions and input hashes."""
    run, blocks = data.evaluation.get("run"), []
    about = run["input"] if run else {}
    if run:
        pairs = facts(run) | {"Versions": ", ".join(f"{k} {v}" for k, v in run["versions"].items())}
        listed = parts.definitions((parts.text(k), parts.cell(v)) for k, v in pairs.items())
        blocks.append(f'<div class="panel">{listed}</div>')
    if notes := about.get("notes"):
        lines = "".join(f"<li>{parts.text(note)}</li>" for note in notes)
        blocks.append(parts.details("Assumptions and findings of the reader", f"<ul>{lines}</ul>"))
    if data.configuration:
        content = f'<div class="panel"><pre>{parts.text(data.configuration)}</pre></div>'
        blocks.append(parts.details("Configuration (TOML)", content))
    if hashes := about.get("files_sha256") or about.get("arrays_sha256"):
        rows = [[parts.text(k), f"<code>{parts.text(v)}</code>"] for k, v in hashes.items()]
        summary = f"Input files<small>{len(rows)}, SHA-256</small>"
        blocks.append(parts.details(summary, html_table(["File", "SHA-256"], rows)))
    return parts.section("The run", *blocks)


def footer(data: ReportData) -> str:
    """Definitions of the metrics."""
    return (
        "<footer><p>PSNR and SSIM are computed per frame and averaged over frames. <em>Full</em>: all pixels, excluded "
        "ones set to zero in render and truth. <em>Tissue</em>: PSNR of the tissue pixels only, and the SSIM map of "
        "the full image averaged over them. <em>8-bit</em>: render rounded to 256 levels first. LPIPS: AlexNet, "
        "version 0.1, excluded pixels zero, values scaled to the given interval.</p></footer>"
    )


SECTIONS = (headline, moving, held_out, temporal_gap, measures_html, pictures, training, components, the_run, footer)


def report_html(data: ReportData) -> str:
    """The page as text."""
    body = [make(data) for make in SECTIONS]
    return parts.page(data.title, "\n".join(part for part in body if part))
