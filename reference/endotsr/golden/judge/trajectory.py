"""Where a trajectory goes wrong first, in words that need no list of mistakes.

In: the first wrong iteration of every output that has one entry an iteration, and the settings of the case. Out: this
iteration, the part of it that is wrong, what is right before that part, and what happens there or just before.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

PARTS = (
    ("images and terms", "term_", "the images and terms"),
    ("loss", "loss", "the weights of the terms"),
    ("sums of the statistics", "gradient_sum visits", "the statistics of density control"),
    ("sums of the moments", "first_moments second_moments", "the gradients and the moments of Adam"),
    ("parameters", "square_", "the rates and the step"),
)
"""What an iteration computes, in this order: a name, how the names of its outputs begin, and where to look."""
CONTROL, CONTROL_CHANGES = "density control", 2  # and the first part that it changes at the end of an iteration
NEAR = 2  # iterations, from an event on, in which it is named
MOST_NAMES = 3  # outputs that are named


class FirstWrong(NamedTuple):
    """Where a trajectory goes wrong."""

    text: str
    events: list[str]  # what happens at this iteration or the one before, and otherwise not


def first_wrong_iteration(wrong: Mapping[str, int], names: Sequence[str], settings: Mapping[str, Any]) -> FirstWrong:
    """The first wrong iteration; no text where no output has one.

    wrong   the first wrong iteration by output
    names   all outputs that have one entry an iteration, in the order of the case
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
            right = ", ".join(part for part, of, _ in PARTS[:k] if _some(names, of))
            said.append(f"look at {place}" + (f", since {right} are right" if right else ""))
            break
    return FirstWrong("; ".join(said + [f"{event} iteration {k}" for event, k in near]), [event for event, _ in near])


def _some(names: Iterable[str], beginnings: str) -> bool:
    """Whether some names begin so."""
    return any(name.startswith(tuple(beginnings.split())) for name in names)


def events(config: Mapping[str, Mapping[str, Any]]) -> Iterator[tuple[str, Iterable[int]]]:
    """What happens at some iterations only, as "it happens at ..."; nothing for a case without a configuration."""
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
