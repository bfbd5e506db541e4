"""Branch coverage of the kernels, run as Python: python tests/kernel_coverage.py [--least 95] [pytest arguments]

Needs coverage.py (`pip install coverage`). Runs a selection of small tests with NUMBA_DISABLE_JIT=1 (about five
minutes) and prints, for every function that is compiled by `jit` or `jit_inline`, the share of its branches that both
ways were taken. Ends with 1 when the total is below --least percent, or when a test failed.
"""

import argparse
import ast
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "reference" / "endotsr"
ROOMS = ("method/equations", "method/splatting", "method/losses", "training/scene", "training/fitting")
SELECTION = [
    "tests/hard/test_kinks.py", "tests/hard/test_platform.py", "tests/properties", "tests/method/equations",
    "tests/method/losses",
    "tests/training/scene", "tests/training/fitting/test_adam.py", "tests/training/fitting/test_fused_step.py",
    "tests/method/splatting/test_compositing.py", "tests/method/splatting/test_harmonics.py",
    "tests/method/splatting/test_projection.py",
    "tests/method/splatting/test_render.py::test_gradients_that_nobody_asks_for_are_not_made",
]  # fmt: skip
# Large arrays and threads; and NaN, which Python's floor refuses where compiled code returns NaN.
LEFT_OUT = (
    "bits or threads or kernels or parallel or shape10 or 100000 or real_masks or isolated or 1100 or 4097 or F7"
    " or P5 or N4 or shrinks or float32_rasteriser or nan_is_not_hidden or published_counts"
)


def kernels(file: Path) -> set[str]:
    """Names of the functions that a module compiles."""
    calls = [node for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    compiling = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id in ("jit", "jit_inline")]
    return {arg.id for call in compiling for arg in call.args if isinstance(arg, ast.Name)}


def measure(arguments: list[str]) -> tuple[int, dict[str, Any]]:
    """Exit status of pytest and the report of coverage.py."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {
            "NUMBA_DISABLE_JIT": "1",
            "COVERAGE_FILE": f"{folder}/data",
            "HYPOTHESIS_PROFILE": "ci",
        }
        run = lambda *words: subprocess.run([sys.executable, "-m", "coverage", *words], cwd=ROOT, env=environment)
        tests = [
            "pytest",
            "-q",
            "-n",
            "0",
            "-p",
            "no:cacheprovider",
            *(arguments or [*SELECTION, "-k", f"not ({LEFT_OUT})"]),
        ]
        status = run("run", "--branch", f"--source={PACKAGE}", "-m", *tests).returncode
        run("json", "-q", "-o", f"{folder}/report.json")
        return status, json.loads(Path(folder, "report.json").read_text(encoding="utf-8"))


def table(report: dict[str, Any]) -> tuple[list[str], float]:
    """One line a kernel with branches not taken, and the percentage of all."""
    lines, taken, there = [], 0, 0
    for name, content in sorted(report["files"].items()):
        file = ROOT / name
        compiled = kernels(file) if "/".join(file.relative_to(PACKAGE).parts[:2]) in ROOMS else set()
        for function, found in content["functions"].items():
            if function not in compiled:
                continue
            summary = found["summary"]
            there += summary["num_branches"]
            taken += summary["covered_branches"]
            if summary["missing_branches"] or summary["missing_lines"]:
                ways = ", ".join(f"{a}->{b}" for a, b in found["missing_branches"])
                lines.append(f"{file.relative_to(PACKAGE)} {function}: {summary['missing_branches']} not taken: {ways}")
    return [*lines, f"{taken} of {there} branches of kernels taken"], 100 * taken / max(there, 1)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--least", type=float, default=95.0, help="percent of branches that must be taken")
    options, arguments = parser.parse_known_args()
    status, report = measure(arguments)
    lines, share = table(report)
    print("\n".join(lines), f"\n{share:.1f} %")
    sys.exit(int(status != 0 or share < options.least))


if __name__ == "__main__":
    main()
