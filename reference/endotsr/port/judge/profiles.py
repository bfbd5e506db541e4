"""Profiles: parts of the method that a port can claim alone, and what is right in each of them, in words.

In: the cases of the vectors, or the verdicts on them. Out: the cases of a profile; one claim for each profile that is
complete up to a level of its own.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import msgspec

from endotsr.errors import InputError
from endotsr.port.judge.format import LEVELS, Case
from endotsr.port.judge.store import Golden
from endotsr.untrusted.names import choice

REVERSE = "d_"  # the names of the outputs of a reverse pass begin with it
WITHOUT = ", without "  # before what a claim leaves out
FILES = ("reading", "generator")
_SCREEN = ("covariance", "projection", "harmonics", "composite")
_LOSSES = ("masked_l1", "masked_ssim", "normalised_depth", "smoothness", "laplacian", "matern")
_DECISIONS = ("adam", "schedule", "density", "initialisation", "calibration")
_TIME = ("frequencies", "dictionary", "atoms", "appearance", "motion", "deformation", "scene")
_METHOD = (*FILES, *_TIME, *_LOSSES, *_SCREEN, *_DECISIONS, "render", "objective")


class Profile(NamedTuple):
    """A part of the method."""

    title: str
    operations: tuple[str, ...]
    says: Mapping[int, str]
    """what is right once a level is complete, by level; the highest key is the last level of the profile"""
    forward: bool = False
    """whether outputs of reverse passes are left out"""

    def asks(self, parts: Iterable[str], output: str) -> bool:
        """Whether an output belongs to the profile; `parts` are the operation and the options of its case."""
        return set(parts) <= set(self.operations) and not (self.forward and output.startswith(REVERSE))


PROFILES = {
    "renderer-forward": Profile(
        "renderer (forward)", (*FILES, *_SCREEN, "render"),
        {1: "shape, projection, colour and compositing of Gaussians", 3: "colour, depth and opacity images"},
        forward=True,
    ),
    "renderer": Profile(
        "renderer with gradients", (*FILES, *_SCREEN, "render"),
        {1: "shape, projection, colour and compositing of Gaussians, forward",
         2: "shape, projection, colour and compositing of Gaussians, forward and reverse",
         3: "images, and their gradients with respect to every parameter and to the pose"},
    ),
    "losses": Profile(
        "losses", (*FILES, *_LOSSES),
        {1: "values of L1, SSIM, depth, smoothness, Laplacian and Matern terms",
         2: "L1, SSIM, depth, smoothness, Laplacian and Matern terms, and their gradients"},
    ),
    "optimiser": Profile(
        "optimiser and density", (*FILES, *_DECISIONS),
        {1: "steps of Adam, rates and weights, density control, first Gaussians, calibration"},
    ),
    "method": Profile(
        "method", _METHOD,
        {1: "every operation forward, and the decisions of training", 2: "every operation, forward and reverse",
         3: "renders and the whole objective with every gradient"},
    ),
    "training": Profile(
        "training", (*_METHOD, "training", "determinism"),
        {4: "the method, and trajectories of training from calibration to density control",
         5: "the method, and trajectories of training, with the same bits in two runs"},
    ),
}  # fmt: skip
"""By the name that `--profile` takes."""


class ProfileClaim(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a port may say of one profile."""

    profile: str
    level: int
    right: str
    """what is right, in words"""


class Graded(NamedTuple):
    """The verdict on one output, as far as a profile needs it."""

    operation: str
    output: str
    level: int
    passed: bool
    options: tuple[str, ...] = ()


def last_level(profile: str) -> int:
    """The highest level of a profile. Raises: InputError for an unknown one."""
    if profile not in PROFILES:
        raise InputError(f"--profile {profile[:40]!a}: no such profile; use {choice(PROFILES)}")
    return max(PROFILES[profile].says)


def of_profile(cases: Iterable[Case], profile: str) -> list[Case]:
    """The cases of a profile with its outputs alone. Raises: InputError for an unknown profile."""
    last_level(profile)
    return _with_outputs(cases, PROFILES[profile])


def without_reverse(golden: Golden) -> Golden:
    """The vectors without the outputs of reverse passes."""
    every = Profile("", tuple({part for case in golden.cases for part in case.parts}), {}, forward=True)
    return golden._replace(cases=_with_outputs(golden.cases, every))


def _with_outputs(cases: Iterable[Case], profile: Profile) -> list[Case]:
    found = []
    for case in cases:
        outputs = {name: one for name, one in case.outputs.items() if profile.asks(case.parts, name)}
        if outputs:
            found.append(msgspec.structs.replace(case, outputs=outputs))
    return found


def complete_level(counts: Mapping[int, tuple[int, int]], *, gaps: bool = False) -> int:
    """The highest level up to which every asked output passed, -1 if none.

    counts   passed and asked outputs by level
    gaps     whether a level without any output is passed over, as in a profile, or ends the count
    """
    reached = -1
    for level, (good, asked) in sorted(counts.items()):
        if good < asked or not (asked or gaps):
            break
        reached = level if asked else reached
    return reached


def claim_text(version: str, profile: str, level: int, precision: str, missing: Iterable[str]) -> str:
    """The claim that a port may publish.

    version   of the vectors, of which major and minor are named
    missing   what the claim leaves out
    """
    short, part = ".".join(version.split(".")[:2]), f"{PROFILES[profile].title}, " if profile else ""
    rest = ", ".join(missing)
    return f"golden {short}, {part}level {level}, {precision}{f'{WITHOUT}{rest}' if rest else ''}"


def profile_claims(graded: Iterable[Graded]) -> list[ProfileClaim]:
    """What is right, profile by profile.

    An operation without any verdict lowers no claim, so for one that a port leaves out, `graded` has a failed verdict.
    """
    graded, found = list(graded), []
    for name, profile in PROFILES.items():
        counts = {level: (0, 0) for level in LEVELS}
        for one in graded:
            if profile.asks((one.operation, *one.options), one.output):
                good, asked = counts[one.level]
                counts[one.level] = (good + one.passed, asked + 1)
        reached = max((level for level in profile.says if level <= complete_level(counts, gaps=True)), default=0)
        if reached:
            found.append(ProfileClaim(profile=name, level=reached, right=profile.says[reached]))
    return found


def lines_of(claims: Iterable[ProfileClaim]) -> list[str]:
    """The claims for a terminal."""
    lines = [f"  {PROFILES[one.profile].title}, level {one.level}: {one.right}" for one in claims]
    return ["right, by profile:", *lines] if lines else []
