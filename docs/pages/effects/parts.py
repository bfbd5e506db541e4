"""Generated parts of docs/effects.md as Markdown, from the JSON of docs/pages/effects/page.py and `bench effects`."""

from statistics import median
from typing import Any, NamedTuple

from endotsr.clips.simulator.sections import SensorNoise
from endotsr.results.report.style import BLUE, GREEN, INK, SMALL, name_axes, new_figure, plain_axes
from endotsr.results.report.tables import markdown
from pages.effects.study import ANSWERS, UNITS
from pages.store.intervals import interval
from pages.store.tables import noted, where_with_cores

ANSWERED = {
    "motion": ("Pixels of tissue move", "time bases (`model.deformation`)", "deformation",
               "any motion above a twentieth of a pixel"),
    "periodic motion": ("The same motion returns at a rate", "Fourier translation (`model.spectral_motion`)",
                        "spectral_motion", "a rate of three cycles or more in the clip"),
    "photometric": ("The light changes: gain, white balance, or in places", "Fourier colour (`model.appearance`)",
                    "appearance", "a change of one grey level or more"),
    "view change": ("A point is seen from several directions", "harmonics above degree 0 (`model.harmonics_degree`)",
                    "harmonics", "views that differ by several degrees, or any motion"),
    "occluders": ("Masks exclude instruments", "mask propagation and total variation under the masks", "",
                  "any excluded pixel; a full mask is recognised and costs nothing"),
    "depth quality": ("Depth has holes, steps or flicker", "smoothness (`loss.smoothness_weight`)", "smoothness",
                      "always, unless no frame has usable depth"),
    "highlights": ("White spots on wet tissue", "none: they are fitted as colour", "", "-"),
    "topology change": ("Tissue is cut, or folds over", "none", "", "leave the frames out, or expect errors there"),
    "smoke": ("A grey veil", "none", "", "leave the frames out"),
    "blur": ("Single frames without detail", "none", "", "leave the frames out"),
}  # fmt: skip


def costs(result: dict[str, Any]) -> str:
    """Effect, appearance, the component that models it, its cost, and its use."""
    rows = []
    for effect, (looks, component, part, worth) in ANSWERED.items():
        measured = result["parts"].get(part)
        time = f"{measured['saved']:.0%}" if measured else "-"
        memory = f"{measured['memory_saved']:.0%}" if measured else "-"
        rows.append((effect, looks, component, time, memory, worth))
    heads = ("Effect", "What it looks like", "Component", "Time", "Memory", "Worth it for")
    parts = result["parts"].values()
    ratios, sizes = [x["off_over_absent"] for x in parts], {x["memory_over_absent"] for x in parts}
    equal = "the same memory" if sizes == {1.0} else "other memory"
    peaks = [x["allocated_over_absent"] for x in parts if "allocated_over_absent" in x]
    if peaks:
        low, high = f"{min(peaks):.3f}", f"{max(peaks):.3f}"
        allocated = "the same amount" if low == high == "1.000" else f"{low} to {high} times as much"
        equal += f", and it allocated {allocated}"
    note = (
        f"Time is processor time of an iteration with {result['gaussians']} Gaussians at "
        f"{result['width']}x{result['height']} ({where_with_cores(result)}); memory is that of Gaussians and "
        f"optimiser. In the same run an iteration with a component off took {min(ratios):.3f} to {max(ratios):.3f} "
        f"times as long as code without that component, with {equal}."
    )
    return noted(heads, rows, note)


def detections(result: dict[str, Any]) -> str:
    """Detections at full amplitude and false positives of each test."""
    rows = [
        (name, _of(x["detected"], x["positives"]), _lower(x["detected"], x["positives"]),
         _of(x["false"], x["negatives"]), _upper(x["false"], x["negatives"]))
        for name, x in result["effects"].items()
    ]  # fmt: skip
    heads = ("Test", "Detected", "95 % lower limit", "False positives", "95 % upper limit")
    first = result["first_seed"]
    note = (
        f"{result['clips']} simulated clips of {result['frames']} frames, seeds {first} to "
        f"{first + result['seeds'] - 1}, none of which was used to set a threshold; noise of "
        f"{255 * SensorNoise().sigma:.2f} grey levels, estimated as {255 * result['noise']:.2f} in the median "
        f"({where_with_cores(result)})."
    )
    return noted(heads, rows, note)


def amplitudes(result: dict[str, Any]) -> str:
    """The smallest amplitude found in every seed, and the next smaller one."""
    rows = []
    for effect, found in result["sweeps"].items():
        missed = max((x["size"] for x in found if x["detected"] < x["clips"]), default=-1.0)
        always = [x for x in found if x["size"] > missed]
        smallest = f"{min(x['size'] for x in always):.2g} {UNITS[effect]}" if always else "none"
        curve = ", ".join(f"{x['size']:.2g}: {x['detected']}/{x['clips']}" for x in found)
        rows.append((effect, ANSWERS[effect], smallest, curve))
    table = markdown(("Effect", "Test", "Smallest amplitude found in every seed", "Found at each amplitude"), rows)
    clips = min(x["clips"] for found in result["sweeps"].values() for x in found)
    none = _upper(0, clips).partition(".")[0]
    return (
        f"{table}\n\nFound in {clips} of {clips} clips means a rate of at least {_lower(clips, clips)}, and in none of "
        f"{clips} a rate of at most {none}%, each with 95 % confidence."
    )


def answer(result: dict[str, Any], plans: dict[str, Any] | None = None, bench: dict[str, Any] | None = None) -> str:
    """The still clip and the real one, trained with `demo`, and the savings of the plan for `paper` on the real one."""
    name, *_ = result["real"]
    still, real = (savings(result["scenes"][clip]) for clip in ("still", name))
    nothing = abs(real.training) < 0.005 and abs(real.gain) < 0.005
    there = f"it saves {percent(real.time)} of the time ({real.gain:+.2f} dB) with `demo`"
    if nothing:
        there = f"there is nothing to save with `demo`, and the inspection costs {percent(-real.time)} of the time"
    plan = plans["clips"][name]["plan"] if plans else {"changes": []}
    changed = f"{still.gain:+.2f} ± {still.interval:.2f} dB"
    times = [savings(pairs).time for pairs in result["scenes"].values()]
    return (
        f"**On {len(times)} clips `--effects auto`, inspection included, saves {percent(median(times))} of the time in "
        f"the median, and {percent(min(times))} to {percent(max(times))} by clip. On a still clip it saves "
        f"{percent(still.time)} of the time and changes the held-out PSNR by {changed}. On the real clip `{name}`, "
        f"{there}.**"
        f"{_without_tracks(plan, bench)}"
    )


def _without_tracks(plan: dict[str, Any], bench: dict[str, Any] | None) -> str:
    """The reason for no savings with `demo` if the plan for `paper` disables the Fourier translation."""
    if [change["key"] for change in plan["changes"]] != ["model.spectral_motion"] or bench is None:
        return ""
    part = bench["parts"]["spectral_motion"]
    return (
        " The reason is that all presets but `paper` need the Fourier translation (`model.spectral_motion`) for the "
        "tracked motion {eq}`eq-b15`. As the motion of this clip has no rate, the "
        "[plan for `paper`](#two-real-clips) switches this component off. In the measurement of the table below, which "
        f"is not of this clip, that saves {part['saved']:.0%} of the time of an iteration and "
        f"{part['memory_saved']:.0%} of the memory of the Gaussians."
    )


def answer_figure(result: dict[str, Any]) -> Any:
    """Time saved by `auto`, and its change of quality with the 95 % interval, one bar per clip."""
    found = {name: savings(pairs) for name, pairs in result["scenes"].items()}
    figure = new_figure(9.0, 0.32 * len(found) + 0.9)
    left, right = figure.subplots(1, 2, sharey=True)
    names, values = list(found), list(found.values())
    left.barh(names, [100 * value.time for value in values], color=BLUE)
    halves = [value.interval for value in values]
    right.barh(names, [value.gain for value in values], xerr=halves, color=GREEN, error_kw={"ecolor": INK})
    for axes, title in ((left, "time saved by `auto`, percent"), (right, "quality against `everything`, dB")):
        plain_axes(axes, sizes=SMALL, grid="x")
        axes.axvline(0, color=INK, linewidth=0.8)
        name_axes(axes, title=title.replace("`", ""), sizes=SMALL)
    left.invert_yaxis()
    return figure


class Savings(NamedTuple):
    """`auto` against `everything`, over the seeds of one clip."""

    gain: float  # dB
    interval: float  # half of the 95 % interval of the gain, dB
    time: float  # fraction saved, the inspection included
    training: float  # the same without the inspection
    memory: float  # fraction saved


def savings(pairs: list[dict[str, Any]]) -> Savings:
    """Paired by seed."""
    gain, half = interval([pair["auto"]["psnr"] - pair["everything"]["psnr"] for pair in pairs])
    spent = {key: sum(pair[key]["seconds"] for pair in pairs) for key in ("auto", "everything")}
    held = {key: sum(p[key]["numbers"] * p[key]["gaussians"] for p in pairs) for key in spent}
    inspected = spent | {"auto": spent["auto"] + sum(pair["inspect_s"] for pair in pairs)}
    return Savings(gain, half, *(1 - of["auto"] / of["everything"] for of in (inspected, spent, held)))


def percent(fraction: float) -> str:
    """Whole percent, without a sign of zero."""
    return f"{fraction:.0%}".replace("-0%", "0%")


def training(result: dict[str, Any]) -> str:
    """`auto` against `everything`, paired by clip and seed."""
    rows = []
    for name, pairs in result["scenes"].items():
        found = savings(pairs)
        level = sum(pair["everything"]["psnr"] for pair in pairs) / len(pairs)
        shown = f"{found.gain:+.2f} ± {found.interval:.2f}"
        rows.append((name, f"{level:.2f}", shown, percent(found.time), percent(found.memory)))
    heads = ("Scene", "`everything`, dB", "`auto` against it, dB", "Time saved", "Memory saved")
    inspections = [pair["inspect_s"] for pairs in result["scenes"].values() for pair in pairs]
    note = (
        f"Held-out tissue PSNR, mean of {result['seeds']} seeds with the 95 % interval of the paired difference; "
        f"preset `demo` with its {result['iterations']} iterations, {result['frames']} frames of 160x128; processor "
        f"time of the training and, with `auto`, of the inspection, which takes {min(inspections):.1f} to "
        f"{max(inspections):.1f} s ({where_with_cores(result)})."
    )
    if result["real"]:
        names = ", ".join(f"`{name}`" for name in result["real"])
        note += f" {names} is a real clip, trained at half size with {result['real_iterations']} iterations."
    return noted(heads, rows, note)


def real(result: dict[str, Any]) -> str:
    """Verdicts on real clips, and their plans."""
    parts = []
    for name, clip in result["clips"].items():
        rows = [
            (effect, v["kind"], f"{v['statistic']:.3g}", f"{v['threshold']:.3g}", v["reason"])
            for effect, v in clip["verdicts"].items()
        ]
        table = markdown(("Effect", "Found", "Statistic", "Threshold", "Reason"), rows)
        changes = [
            f"- `{c['key']}` = {str(c['value']).lower()} (was {str(c['before']).lower()}): {c['reason']}"
            for c in clip["plan"]["changes"]
        ]
        plan = "\n".join(changes) or "- nothing"
        parts.append(
            f"**`{name}`**: {clip['training_frames']} training frames.\n\n{table}\n\n"
            f"The plan for `paper` changes:\n\n{plan}"
        )
    return "\n\n".join(parts)


def _of(count: int, total: int) -> str:
    return f"{count} of {total}" if total else "-"


def _lower(count: int, total: int) -> str:
    """Exact (Clopper-Pearson) one-sided 95 % lower limit of a rate: of 5 of 5 it is 55 %."""
    from scipy import stats

    return f"{float(stats.beta.ppf(0.05, count, total - count + 1)):.0%}" if count else "-"


def _upper(count: int, total: int) -> str:
    """Exact (Clopper-Pearson) one-sided 95 % upper limit of a rate."""
    from scipy import stats

    if total == 0:
        return "-"
    return f"{float(stats.beta.ppf(0.95, count + 1, total - count)) if count < total else 1.0:.1%}"
