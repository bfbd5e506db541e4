"""Errors of trained scenes against the truth of the simulator, and the leakage between light and motion.

In one scene only the light changes; in the other only the tissue moves. Each is trained with presets, and with
components removed from the preset `paper`. The measurements are depth, trajectories, and the colour residual at pieces
of tissue against the true change of their light. In the first scene all motion is wrong. In the second, every change of
colour is wrong except for the change of light caused by motion under the lamp.
"""

import argparse
from typing import Any

import numpy as np

from endotsr.results.report.tables import markdown
from pages.store import kept
from pages.store.intervals import shown
from pages.store.tables import means, where_with_cores

ITERATIONS, FRAMES = 1000, 24
GREY = 255.0  # grey levels of a display unit
GRID = (16, 12)  # pieces of tissue, across and down
SCENES = {"light": ("noise", "exposure", "brightening"), "motion": ("noise", "breathing", "pulsation")}
TRUE_SIZES = ("light_grey", "motion_scene_units", "motion_pixels")
VARIANTS: dict[str, tuple[str, dict[str, dict[str, Any]]]] = {
    "`paper`": ("paper", {}),
    "`paper` without A": ("paper", {"model": {"appearance": False}}),
    "`paper` without S": ("paper", {"model": {"spectral_motion": False}}),
    "`paper` without A and S": ("paper", {"model": {"appearance": False, "spectral_motion": False}}),
    "`paper` without the prior": ("paper", {"loss": {"lambda_msp": 0.0}}),
    "`sharp`": ("sharp", {}),
    "`demo`": ("demo", {}),
}
"""Name in the table -> preset, and settings on top of it."""


def truth(options: argparse.Namespace) -> dict[str, Any]:
    """Every scene with every variant and seed: JSON-able, "scenes" {scene: {variant: rows of `scores`}}."""
    runs = [(scene, variant, seed) for seed in range(options.seeds) for scene in SCENES for variant in VARIANTS]
    about = {"frames": FRAMES, "iterations": options.iterations}
    measure = lambda scene, variant, seed: scores(simulated_scene(scene, seed), variant, seed, options.iterations)
    identity = about | {"sources": kept.sources("", beside=("effects/study",))}
    scenes = kept.nested(kept.measured(options.record, identity, runs, measure))
    return {"seeds": options.seeds, **about, "scenes": scenes}


def simulated_scene(scene: str, seed: int) -> Any:
    """160x128 pixels."""
    from endotsr.clips.simulator.simulate import simulate
    from pages.effects.study import settings_of

    return simulate(settings_of(SCENES[scene], seed, FRAMES))


def scores(simulated: Any, variant: str, seed: int, iterations: int) -> dict[str, float]:
    """Train a variant, with the number of points and the density control of `demo`, and measure it."""
    from endotsr.api import make_config
    from endotsr.api import train as fit
    from endotsr.config import DEMO
    from endotsr.results.evaluation.trajectories import trajectory_error

    preset, sections = VARIANTS[variant]
    points = {key: getattr(DEMO.initialisation, key) for key in ("first_frame_points", "other_frame_points")}
    threshold = {"gradient_threshold": DEMO.density.gradient_threshold}
    training = {"seed": seed, "threads": 1}
    config = make_config(
        preset, iterations=iterations, training=training, initialisation=points, density=threshold,
        model=sections.get("model", {}), loss=sections.get("loss", {}),
    )  # fmt: skip
    run = fit(simulated.sequence, config, on_message=lambda line: None)
    motion = trajectory_error(run.model, simulated.sequence, simulated.true_positions)
    assert motion is not None  # the scenes have tissue
    psnr = run.evaluate()["held_out"]["mean"]["psnr_tissue"]
    return {"psnr": psnr, "depth_mm": depth_error(run, simulated)} | motion._asdict() | light_scores(run, simulated)


def depth_error(run: Any, simulated: Any) -> float:
    """Mean of |D / O - z| over the tissue of the held-out frames, mm: rendered depth over opacity, true depth."""
    sequence, found = simulated.sequence, []
    for i in sequence.test_index:
        rendered = run.render(float(sequence.times[i]), int(i))
        seen = sequence.masks[i] & (rendered.opacity > 0)
        found.append(np.abs(rendered.depth[seen] / rendered.opacity[seen] - simulated.truth.depth[i][seen]))
    return float(np.concatenate(found).mean())


def light_scores(run: Any, simulated: Any) -> dict[str, float]:
    """RMS over time of the true change of light of pieces of tissue, of the colour residual there, and of their
    difference, in grey levels; all against their mean over time."""
    true, modelled = light_courses(run, simulated)
    true, modelled = (course - course.mean(axis=0) for course in (true, modelled))
    sizes = {"light_grey": true, "colour_grey": modelled, "light_error_grey": modelled - true}
    return {name: float(np.sqrt((course**2).mean())) for name, course in sizes.items()}


def light_courses(run: Any, simulated: Any) -> tuple[np.ndarray, np.ndarray]:
    """True display colour, and the colour residual of the model, of pieces of tissue visible in all frames, (n, 3, P).

    The residual is the difference of the renders with and without component A, at the pixel of the piece.
    """
    from endotsr.clips.simulator.folder import tissue_light
    from endotsr.clips.simulator.frames import make_scene
    from endotsr.clips.simulator.gain import gain_series, to_display
    from endotsr.clips.simulator.trajectories import material_at, material_tracks

    sequence, scene = simulated.sequence, make_scene(simulated.settings)
    height, width = sequence.height, sequence.width
    x, y = ((np.arange(n) + 0.5) / n * side for n, side in zip(GRID, (width, height)))
    tracks = material_tracks(simulated, material_at(simulated, np.stack(np.meshgrid(x, y)).reshape(2, -1)))
    seen = tracks.visible.all(axis=0)
    gain = gain_series(simulated.settings, sequence.times)
    true, modelled = [], []
    for i, t in enumerate(sequence.times):
        light = tissue_light(scene, tracks.material[:, seen], i)
        true.append(GREY * to_display(light * gain[i][:, None]))
        column, row = np.floor(tracks.pixel[i][:, seen]).astype(int)
        whole, rest = (run.render(float(t), i, without=names).colour for names in ((), ("appearance",)))
        modelled.append(GREY * (whole - rest)[:, row, column])
    return np.array(true), np.array(modelled)


def table(result: dict[str, Any]) -> str:
    """The two scenes as two tables."""
    light, motion = (result["scenes"][name] for name in ("light", "motion"))
    errors = [(name, 2) for name in ("psnr", "depth_mm", "scene_units", "pixels")]
    first = markdown(
        ("Light alone", "PSNR, dB", "Depth error, mm", "False motion, mm", "False motion, px", "Light explained"),
        [
            (name, *means(rows, errors), _part(rows, "light_error_grey", "light_grey", 2))
            for name, rows in light.items()
        ],
    )
    heads = (
        "Motion alone", "PSNR, dB", "Depth error, mm", "Trajectory error, mm", "Trajectory error, px",
        "Motion explained", "Colour residual, grey levels", "Its error, grey levels",
    )  # fmt: skip
    colours = (("colour_grey", 2), ("light_error_grey", 2))
    moves = ("scene_units", "motion_scene_units")
    second = markdown(
        heads,
        [(name, *means(r, errors), _part(r, *moves, 1), *means(r, colours)) for name, r in motion.items()],
    )
    runs = sum(len(rows) for scene in (light, motion) for rows in scene.values())
    lit, moved = (  # the true sizes are the same for all variants, and differ between the seeds
        {key: float(np.mean([row[key] for row in scene["`paper`"]])) for key in TRUE_SIZES} for scene in (light, motion)
    )
    note = (
        f"Mean over {result['seeds']} seeds with the 95 % interval; {result['iterations']} iterations, "
        f"{result['frames']} frames of 160x128, {runs} runs ({where_with_cores(result)}). PSNR and depth error are "
        "over the tissue of the held-out frames. With light alone the "
        f"light of a piece of tissue changes by {lit['light_grey']:.1f} grey levels (RMS). With motion alone the "
        f"tissue moves by {moved['motion_scene_units']:.2f} mm ({moved['motion_pixels']:.2f} px), and its light "
        f"changes by {moved['light_grey']:.1f} grey levels, because it moves under the lamp."
    )
    note += " All runs begin with as many points as `demo` and have its threshold of growth"
    same = [name for name in light if name != "`sharp`" and _same(result, name, "`sharp`")]
    note += f", with which the settings of {' and '.join(same)} are those of `sharp` at this length." if same else "."
    return f"{first}\n\n{second}\n\n{note}\n\n{gains(result)}"


def _same(result: dict[str, Any], first: str, second: str) -> bool:
    """Whether two variants have the same numbers in every scene."""
    return all(scene[first] == scene.get(second) for scene in result["scenes"].values())


def gains(result: dict[str, Any]) -> str:
    """What A changes, paired by seed."""
    of = {
        name: shown([a["psnr"] - b["psnr"] for a, b in zip(scene["`paper`"], scene["`paper` without A"], strict=True)],
                    2, "+")
        for name, scene in result["scenes"].items()
    }  # fmt: skip
    return (
        f"Paired by seed, A changes the held-out PSNR of `paper` by {of['light']} dB with light alone and by "
        f"{of['motion']} dB with motion alone."
    )


def _part(rows: list[dict[str, float]], error: str, whole: str, power: int) -> str:
    """1 - (error / whole)^power in percent: power 2 for a fraction of the variance, 1 for one of the length."""
    return shown([100 * (1 - (row[error] / row[whole]) ** power) for row in rows], 0) + " %"
