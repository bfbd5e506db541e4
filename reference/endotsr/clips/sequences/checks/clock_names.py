"""Names of pictures that state a time of day, whose numbers do not ascend with time: past midnight, or with AM and PM.

In: files in the order in which they are read. Out: findings.
"""

import re
from itertools import pairwise
from pathlib import Path

import numpy as np

from endotsr.clips.sequences.checks.kinds import Finding, finding

# Hours, minutes and seconds at every place of a name, also where they overlap; a fraction of a second may follow.
TIME = re.compile(r"(?<!\d)(?=([01]\d|2[0-3])[-_.:h]?([0-5]\d)[-_.:m]?([0-5]\d)(?:[-_.:s]?\d{1,9})?(?!\d))")
HALF_DAY = re.compile(r"(?<!\d)(1[0-2]|0?[1-9])[-_.:]([0-5]\d)(?:[-_.:]([0-5]\d))?[-_.\s]*([ap])\.?m\b", re.IGNORECASE)
DAY, NEAR = 86400, 60  # seconds of a day; between the last picture before midnight and the first one after it


def clock_findings(files: list[Path]) -> list[Finding]:
    """A warning on names whose times of day are in another order than the files."""
    if len(files) < 3:
        return []
    return _past_midnight(files) or _half_days(files)


def _past_midnight(files: list[Path]) -> list[Finding]:
    """Times that reach from midnight to midnight with a hole of more than half a day."""
    found = [_times(file.stem) for file in files]
    for place in sorted(set.intersection(*map(set, found))):
        times = [one[place] for one in found]
        steps = np.diff(times)
        k = int(steps.argmax())
        around, others = DAY - times[-1] + times[0], np.delete(steps, k)
        if steps.min() >= 0 and steps[k] > DAY / 2 and around <= max(NEAR, 2 * others.max()):
            what = (
                f"by its name, {files[k + 1].name} is {steps[k] / 3600:.1f} hours after {files[k].name}, and the first"
            )
            return [
                finding("order-of-names", files[0].parent, f"{what} picture follows the last one past midnight", k + 1)
            ]
    return []


def _times(name: str) -> dict[int, int]:
    """Seconds of the times in a name, by the number of groups of digits before them."""
    return {
        len(re.findall(r"\d+", name[: match.start()])): _seconds(match[1], match[2], match[3])
        for match in TIME.finditer(name)
    }


def _half_days(files: list[Path]) -> list[Finding]:
    """Times with AM and PM that go back where their numbers ascend."""
    found = [HALF_DAY.search(file.stem) for file in files]
    keys = [
        ([int(digits) for digits in re.findall(r"\d+", file.stem[: match.start()])],
         _seconds(int(match[1]) % 12 + 12 * (match[4] in "pP"), match[2], match[3] or 0))
        for file, match in zip(files, found) if match
    ]  # fmt: skip
    back = [k for k, (one, other) in enumerate(pairwise(keys), 1) if other < one]
    if len(keys) < len(files) or not back:
        return []
    what = f"{files[back[0]].name} is earlier than {files[back[0] - 1].name}, and comes after it"
    return [finding("order-of-names", files[0].parent, what, back[0])]


def _seconds(hours: str | int, minutes: str, seconds: str | int) -> int:
    return 3600 * int(hours) + 60 * int(minutes) + int(seconds)
