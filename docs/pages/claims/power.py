"""Power of the paired t test of the claims: the smallest true difference that a number of seeds distinguishes from 0.

The spread of a difference between two runs of one seed is pooled over the comparisons of a kind (free number of
Gaussians, fixed number), because three differences alone estimate their spread badly.
"""

from functools import lru_cache
from typing import Any

import numpy as np

from endotsr.studies.sweeps.ablation import BOTH, COMPARISONS, FIXED
from pages.claims.estimates import spread as variance
from pages.claims.rules import LEAST_PAIRS

POWER, LEVEL = 0.8, 0.05
NAMES = {"ssim_tissue": "SSIM of tissue", "lpips": "LPIPS"}
FREE, AT_FIXED = "a free number of Gaussians", "a fixed number"
Record = dict[str, Any]


@lru_cache
def power(size: float, pairs: int) -> float:
    """Probability that the 95 % interval of `pairs` differences excludes 0.

    size   true mean over the true standard deviation. Integrated over the variance: P(|Z + size sqrt(n)| > t s).
    """
    from scipy import integrate, stats

    freedom, shift = pairs - 1, size * np.sqrt(pairs)
    bound = stats.t.ppf(1 - LEVEL / 2, freedom)

    def weighted(u: float) -> float:
        reach = bound * np.sqrt(u / freedom)
        return float(stats.chi2.pdf(u, freedom) * (stats.norm.sf(reach - shift) + stats.norm.cdf(-reach - shift)))

    return float(integrate.quad(weighted, 0.0, stats.chi2.ppf(1 - 1e-12, freedom), limit=200)[0])


@lru_cache
def least_size(pairs: int) -> float:
    """The mean over the standard deviation that is distinguished from 0 with a probability of POWER."""
    from scipy import optimize

    found = optimize.root_scalar(lambda size: power(size, pairs) - POWER, bracket=(1e-3, 100.0), method="brentq")
    return float(found.root)


@lru_cache
def pairs_needed(size: float) -> int:
    """The smallest number of seeds that distinguishes a mean over the standard deviation from 0."""
    low, high = 1, 2
    while power(size, high) < POWER:
        low, high = high, 2 * high
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if power(size, middle) >= POWER else (middle, high)
    return high


def spread(found: Record, metric: str, kind: str) -> float:
    """Pooled standard deviation of a paired difference between seeds."""
    of_kind = [r for r in found["increments"] if r["metric"] == metric and kind_of(r["claim"]) == kind]
    chosen = [row["of"] for row in of_kind if row["pairs"] > 1]
    sums = [np.square(d - d.mean()).sum() for d in (np.array([p["difference"] for p in of]) for of in chosen)]
    freedom = sum(len(of) - 1 for of in chosen)
    return float(np.sqrt(np.sum(sums) / freedom))


def kind_of(claim: str) -> str:
    """Whether both configurations of a claim have the same Gaussians."""
    return AT_FIXED if FIXED in claim.replace(",", "") else FREE


def sentences(found: Record | None, clip: str) -> str:
    """The smallest difference that the seeds of a clip resolve, and the seeds needed for the published gains."""
    if found is None or not found["increments"]:
        return "Not measured yet."
    pairs = max(row["pairs"] for row in found["increments"])
    spreads = {kind: spread(found, "psnr_full", kind) for kind in (FREE, AT_FIXED)}
    seen = ", or ".join(
        f"{least_size(pairs) * deviation:.2f} dB with {kind} (standard deviation {deviation:.3f} dB)"
        for kind, deviation in spreads.items()
    )
    gains = [(c.claim, clip, of["psnr_full"]) for c in COMPARISONS for clip, of in c.published.items()]
    needed = ", ".join(
        f"{claim}{'' if clip == BOTH else f' ({clip})'} {gain:+.2f} dB: "
        f"{max(LEAST_PAIRS, pairs_needed(gain / spreads[kind_of(claim)]))}"
        for claim, clip, gain in gains
    )
    return (
        f"**Power.** With the spread of {clip}, {pairs} seeds distinguish a true difference from 0 with a probability "
        f'of {100 * POWER:.0f} % if it is {seen}, and a smaller one less often: "not decided" does not mean that '
        f"there is none. With this spread and this probability the published gains need this many seeds, "
        f"at least {LEAST_PAIRS} for a verdict: {needed}."
    )


def common_spread(found: Record | None, clip: str) -> str:
    """The standard deviation of the run x seed analysis of variance, with its degrees of freedom."""
    if found is None:
        return f"EndoNeRF {clip}: not measured yet."
    shown = []
    for kind, fixed in ((FREE, False), (AT_FIXED, True)):
        of = {metric: variance(found, metric, fixed) for metric in ("psnr_full", "ssim_tissue", "lpips")}
        known = {metric: value for metric, value in of.items() if value is not None}
        if first := known.get("psnr_full"):
            rest = ", ".join(f"{NAMES[m]} {value.deviation:.5f}" for m, value in known.items() if m != "psnr_full")
            shown.append(
                f"with {kind} {first.deviation:.3f} dB ({rest}) from {first.configurations} configurations and "
                f"{first.seeds} seeds, {first.freedom} degrees of freedom"
            )
    return f"EndoNeRF {clip}: {'; '.join(shown)}." if shown else f"EndoNeRF {clip}: not enough seeds yet."
