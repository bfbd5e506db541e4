"""The report of a run as one self-contained HTML page: metrics, baselines, pictures, curves, settings.

The functions follow the order of the sections; each returns "" if its data is missing. The page embeds all pictures and
needs no script and no other file. It follows the reader's light or dark colour scheme and is readable on a phone. It
links to the viewer page, if there is one.
"""

import numpy as np

from endotsr.results.evaluation.evaluate import all_extrapolated
from endotsr.results.report import curves, figures, parts
from endotsr.results.report.data import DECIDING, FramePictures, ReportData
from endotsr.results.report.held_out import baseline_rows, extrapolated_frames, held_out, mean_of
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

OPENED_FRAMES = 3  # the worst frames are unfolded


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
        word, what = ("above", "gain") if ours > faded else ("below", "gain no")
        sentences.append(
            f"On held-out tissue the model is {abs(ours - faded):.2f} dB {word} the blend of its own renders at the "
            f"two neighbouring training times: its motion and colour between them {what} PSNR."
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


def pictures(data: ReportData) -> str:
    """Render, truth, error and depth of the given held-out frames, worst first."""
    if not data.frames:
        return ""
    errors = [figures.tissue_error(f.render, f.truth, f.mask) for f in data.frames]
    scale = figures.error_scale(errors)
    order = sorted(range(len(errors)), key=lambda i: (-_squared(data.frames[i]), data.frames[i].index))
    depths = [f for f in data.frames if f.depth is not None]
    span = _depth_span(depths)
    legend = [f"Error {parts.colour_bar(figures.ERROR_MAP, '0', f'{scale:g} or more')}"]
    if depths:
        bar = parts.colour_bar(figures.DEPTH_MAP, f"{span[0]:.4g}", f"{span[1]:.4g} {data.depth_unit}")
        legend.append(f"Rendered depth {bar}")
    legend += [
        f"{words} {parts.colour_box(colour)}"
        for (times, colour), words in zip(figures.SELDOM_SEEN.items(), ("Never seen in training", "Seen once"))
        if any(f.seen is not None and (f.mask & (f.seen == times)).any() for f in data.frames)
    ]
    note = (
        "Worst first. Error: absolute difference, averaged over the colour channels, in display units from 0 to 1, "
        "with the same scale for all frames. Grey: excluded or without depth. The white border marks the window with "
        "the largest tissue error, enlarged 4×."
    )
    frames = len(data.evaluation.get("held_out", {}).get("per_frame", ()))
    if frames > len(data.frames):
        note = f"The {len(data.frames)} worst of {frames} frames; see renders/ for all of them. {note}"
    blocks = [_frame(data.frames[i], scale, span, position < OPENED_FRAMES) for position, i in enumerate(order)]
    return parts.section(
        "Pictures of the held-out frames", f'<div class="legend">{"".join(legend)}</div>', *blocks, note=note
    )


def _squared(frame: FramePictures) -> float:
    """Mean squared tissue error, for the order of the frames; infinite for a render that is not finite."""
    error = np.where(frame.mask, np.clip(frame.render, 0, 1) - frame.truth, 0.0)
    value = float(np.square(error, dtype=np.float64).sum() / max(3 * frame.mask.sum(), 1))
    return value if np.isfinite(value) else np.inf


def _depth_span(frames: list[FramePictures]) -> tuple[float, float]:
    spans = [figures.depth_range(f.depth, f.mask) for f in frames if f.depth is not None]
    return (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else (0.0, 1.0)


def _frame(frame: FramePictures, scale: float, span: tuple[float, float], opened: bool) -> str:
    panels = figures.triptych(frame.render, frame.truth, frame.mask, scale)
    views = [("Render", panels.render), ("Truth", panels.truth), ("Error", panels.error)]
    if frame.depth is not None:
        views.append(("Depth", figures.depth_picture(frame.depth, *span, mask=frame.mask)))
    seldom = 0 if frame.seen is None else int(np.count_nonzero(frame.mask & (frame.seen <= 1)))
    if seldom:
        views.append(("Seen", figures.seen_picture(frame.truth, frame.mask, frame.seen)))
    cells = []
    for label, picture in views:
        name = f"{label}, frame {frame.index}"
        whole = parts.image(figures.framed(picture, panels), name)
        inset = parts.image(panels.window(picture), f"{name}, enlarged", "inset")
        cells.append(f"<div>{whole}<span>{label}</span></div><div>{inset}<span>4×</span></div>")
    shown = [f"t = {frame.time:.3f}"]
    for key, before, digits, after in (("psnr_tissue", "tissue", 2, " dB"), ("ssim_tissue", "SSIM", 4, "")):
        if (value := (frame.metrics or {}).get(key)) is not None:
            shown.append(f"{before} {parts.number(value, digits)}{after}")
    if seldom:
        shown.append(f"{seldom} px never seen in training or once")
    facts = " · ".join([*shown, parts.text(frame.name)])
    summary = f"Frame {frame.index}<small>{facts}</small>"
    return parts.details(summary, f'<div class="views">{"".join(cells)}</div>', opened)


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


SECTIONS = (headline, moving, held_out, temporal_gap, pictures, training, components, the_run, footer)


def report_html(data: ReportData) -> str:
    """The page as text."""
    body = [make(data) for make in SECTIONS]
    return parts.page(data.title, "\n".join(part for part in body if part))
