"""The first wrong iteration of a trajectory, described without a list of mistakes.

In: the first wrong iteration of every wrong output with one entry per iteration, and the settings of the case. Out:
the lowest of them, its first wrong part, the right parts before it, and the events there or one iteration before.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

PARTS = (
    ("images and terms", "term_", "the images and terms"),
    ("loss", "loss", "the weights of the terms"),
    ("sums of the statistics", "gradient_sum visits", "the statistics of density control"),
    ("sums of the moments", "first_moments second_moments", "the gradients and the moments of Adam"),
    ("parameters", "square_", "the rates and the step"),
)
"""Parts of an iteration in order of computation: a name, prefixes of its outputs, and the place to look at."""
CONTROL, CONTROL_CHANGES = "density control", 2  # and the index of the first part that it changes
NEAR = 2  # iterations, from an event on, that mention it
MOST_NAMES = 3  # outputs listed by name


class FirstWrong(NamedTuple):
    """The first wrong iteration of a trajectory."""

    text: str
    events: list[str]  # events at this iteration or the one before


def first_wrong_iteration(
    wrong: Mapping[str, int], names: Sequence[str], settings: Mapping[str, Any], absent: Collection[str] = ()
) -> FirstWrong:
    """The first wrong iteration; without text if there is none.

    wrong    the first wrong iteration by output, from 1
    names    all outputs with one entry per iteration, in the order of the case
    absent   those that could not be compared: a part with one of them is not called right
    """
    if not wrong:
        return FirstWrong("", [])
    first = min(wrong.values())
    bad = [name for name in names if wrong.get(name) == first]
    more = f" and {len(bad) - MOST_NAMES} more" if len(bad) > MOST_NAMES else ""
    said = [f"first wrong at iteration {first}: {', '.join(bad[:MOST_NAMES])}{more}"]
    near = [(event, k) for event, at in events(settings.get("config", {})) for k in at if 0 <= first - k < NEAR]
    for k, (_, beginnings, place) in enumerate(PARTS):
        if _some(bad, beginnings):
            place += f" and {CONTROL}" if k >= CONTROL_CHANGES and (f"{CONTROL} ends", first) in near else ""
            right = ", ".join(part for part, of, _ in PARTS[:k] if _some(names, of) and not _some(absent, of))
            are = "is" if right == "loss" else "are"
            said.append(f"look at {place}" + (f", since {right} {are} right" if right else ""))
            break
    return FirstWrong("; ".join(said + [f"{event} iteration {k}" for event, k in near]), [event for event, _ in near])


def _some(names: Iterable[str], beginnings: str) -> bool:
    """Whether any name has one of these prefixes."""
    return any(name.startswith(tuple(beginnings.split())) for name in names)


def events(config: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Iterable[int]]]:
    """Events with their iterations, as ("it happens at", iterations); none for a case without a configuration."""
    if not config:
        return
    model, loss, training, density = (config[part] for part in ("model", "loss", "training", "density"))
    if model["appearance"] or model["spectral_motion"]:
        yield "the residuals begin at", [training["residual_activation"] + 1]
    if model["laplacian"]:
        yield "the detail weight leaves 0 at", [loss["laplacian_from"] + 1]
        yield "the detail weight is full from", [loss["laplacian_full"]]
    if loss["smoothness_weight"] > 0:
        yield "the smoothness begins at", [loss["smoothness_from"]]
    steps = range(1, model["harmonics_degree"] + 1)
    yield "the harmonic degree rises at", [training["harmonics_interval"] * k for k in steps]
    yield "rates are annealed from", [config["optimiser"]["annealing_from"] + 1]
    inside = range(density["start"] + 1, density["until"])
    yield f"{CONTROL} ends", [i for i in inside if i % density["interval"] == 0]
    yield "statistics are gathered before", [density["until"]]
