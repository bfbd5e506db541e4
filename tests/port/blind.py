"""Kinds of a blind set of mistakes, drawn before its author reads the judge: python tests/port/blind.py [SEED]

Prints 50 pairs of an operation and a kind of mistake. The protocol:

1. Somebody who has not read `reference/endotsr/port/judge`, `port/search` or the lists of mistakes draws the kinds
   with a new seed, and writes one mistake for each into a port of their own. A pair without a sensible mistake is
   replaced by the next one of the draw, and the replacement is noted.
2. Before the judge runs, each mistake has its sentence: what is wrong, in which operation.
3. The judge runs once on every mistake, in float64 at level 4, with the default time of the search.
4. Each report gets one outcome by the sentence: named rightly; near (right line, misleading reading); wrongly named;
   placed (no name, but the right line, output, event or case); nothing useful.
5. The counts go into `docs/results/blind_mistakes.json` with date and version. The mistakes may then be used to improve
   the judge, and the set is blind no more.
"""

import argparse
import random
from typing import NamedTuple

COUNT = 50
# Operations of the golden cases that compute something, as `golden/README.md` lists them.
OPERATIONS = (
    "dictionary", "atoms", "appearance", "motion", "matern", "laplacian", "calibration", "deformation", "covariance",
    "projection", "harmonics", "composite", "masked_l1", "masked_ssim", "normalised_depth", "smoothness", "exposure",
    "pose", "schedule", "density", "initialisation", "adam", "render", "scene", "objective", "training",
)  # fmt: skip
KINDS = (
    "a factor is missing or doubled",
    "a sign is wrong",
    "an index or an order is wrong",
    "a boundary: < for <=, one too many or too few",
    "a constant has another value",
    "a term of the reverse pass is missing",
    "a mask, a count or a mean is taken over other elements",
    "a clamp is missing, elsewhere, or passes its gradient",
    "a lower precision in one place",
    "a habit of another program: its convention in place of ours",
    "two independent mistakes at once",
)


class Pair(NamedTuple):
    """What is to be mistaken, and how."""

    operation: str
    kind: str


def drawn(seed: int, count: int = COUNT) -> list[Pair]:
    """Distinct pairs in the order of the draw; the same seed gives the same pairs on every system."""
    pairs = [Pair(operation, kind) for operation in OPERATIONS for kind in KINDS]
    return random.Random(seed).sample(pairs, min(count, len(pairs)))


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument(
        "seed", type=int, nargs="?", default=random.SystemRandom().randrange(2**32), help="of the draw"
    )
    asked = options.parse_args()
    print(f"seed {asked.seed}")
    for number, pair in enumerate(drawn(asked.seed), 1):
        print(f"{number:3d}  {pair.operation:17} {pair.kind}")
