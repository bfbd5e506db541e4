"""One call of a port by the judge: requests, the command, the verdict."""

import time
from pathlib import Path

from endotsr.port.judge.command import KEPT, clear_kept, refuse_command, run_port, write_requests
from endotsr.port.judge.format import Precision
from endotsr.port.judge.records import Report
from endotsr.port.judge.store import Golden
from endotsr.port.judge.verdict import asked_of, judge, without_claim


def called(
    golden: Golden, port: str, root: Path, precision: Precision, *, level: int, only: str = "", timeout: float = 600.0,
    profile: str = "",
) -> tuple[Report, Path]:  # fmt: skip
    """Write requests below `root`, call the port (twice for level 5), and judge. Returns report and output folder.

    timeout   of one call, seconds

    Raises: InputError if the command cannot be used, or `root` has folders that no earlier call made.
    """
    refuse_command(port, timeout)
    requests, *folders = (root / name for name in KEPT)
    clear_kept(root)
    asked, level = asked_of(golden, only, profile, level)
    write_requests(asked, requests, precision, level)
    calls, began = folders if level >= 5 else folders[:1], time.monotonic()
    notes = [run_port(port, requests, folder, timeout) for folder in calls]
    seconds = time.monotonic() - began
    again = folders[1] if level >= 5 else None
    report = judge(golden, folders[0], precision, level=level, again=again, only=only, profile=profile)
    report.seconds = seconds
    if any(notes):
        without_claim(report, list(filter(None, notes)))
    return report, folders[0]
