"""Tables of docs/guides/run_folder.md from the results of the campaigns: python docs/make.py book.reliability

docs/results/faults.json   python tests/faults/campaign.py --kills 50 --json docs/results/faults.json
docs/results/fuzz.json     python tests/fuzz/campaign_of_inputs.py --json docs/results/fuzz.json
docs/results/soak.json     python tests/faults/soak.py --json docs/results/soak.json --plot docs/results/soak.png
docs/results/large.json    python tests/faults/large.py --json docs/results/large.json
"""

from pathlib import Path
from typing import Any

from pages.store.marks import read_json, write_marked

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "guides" / "run_folder.md"
RESULTS = ROOT / "docs" / "results"
MAKERS = {
    "faults": "python tests/faults/campaign.py --kills 50 --json docs/results/faults.json",
    "fuzz": "python tests/fuzz/campaign_of_inputs.py --json docs/results/fuzz.json",
    "soak": "python tests/faults/soak.py --json docs/results/soak.json",
    "large": "python tests/faults/large.py --json docs/results/large.json",
}


def parts() -> dict[str, str]:
    """The generated parts of the page by name."""
    written = {"faults": faults, "fuzz": fuzz, "soak": soak, "large": large}
    return {
        name: written[name](read_json(RESULTS / f"{name}.json", command))
        if (RESULTS / f"{name}.json").exists()
        else f"No result is stored yet; the command is `{command}`."
        for name, command in MAKERS.items()
    }


def faults(result: dict[str, Any]) -> str:
    """One row per fault."""
    rows = [f"| {r['fault']} | {r['as_promised']} of {r['trials']} | {r['what']} |" for r in result["faults"]]
    return "\n".join(["| Fault | As promised | What happens |", "|---|---|---|", *rows, "", made(result)])


def fuzz(result: dict[str, Any]) -> str:
    """One row per reader, and the sum."""
    readers = result["readers"]
    rows = [f"| {r['reader']} | {r['inputs']} | {r['seconds']} | {r['findings']} |" for r in readers]
    total = [sum(r[key] for r in readers) for key in ("inputs", "seconds", "findings")]
    rows.append(f"| together | {total[0]} | {total[1]} | {total[2]} |")
    bound = f"Memory bound: {result['memory'] >> 20} MiB above the start. {made(result)}"
    return "\n".join(["| Reader | Inputs | Seconds | Findings in this run |", "|---|---|---|---|", *rows, "", bound])


def soak(result: dict[str, Any]) -> str:
    """The memory of a long run and the cost of the guard, in a sentence each."""
    run, guard = result["soak"], result["guard"]
    return "\n".join(
        [
            f"Over {run['iterations']} iterations of a small scene, after the first quarter of them, the resident"
            f" memory stays at {run['median_bytes'] / 1e6:.0f} MB, within {run['largest_deviation']:.2%} of it.",
            f"The check of the gradients of {guard['gaussians']} Gaussians takes {1e3 * guard['seconds']:.2f} ms an"
            " iteration.",
            made(result),
            "",
            "![Resident memory over the iterations, a horizontal line](../results/soak.png)",
        ]
    )


def large(result: dict[str, Any]) -> str:
    """A million Gaussians, and more threads than cores, in a sentence each."""
    many, threads = result["many"], result["threads"]
    return "\n".join(
        [
            f"{many['gaussians']} Gaussians in pictures of {many['width']}x{many['height']}: an iteration takes"
            f" {many['iteration_seconds']:.2f} s, the process {many['peak_bytes'] / 1e9:.2f} GB, the checkpoint"
            f" {many['checkpoint_bytes'] / 1e9:.2f} GB.",
            f"A tiny training with {threads['threads']} threads on {threads['cores']} cores gives the bits of one"
            f" thread, in {threads['seconds']:.1f} s in place of {threads['seconds_of_one']:.1f} s.",
            made(result),
        ]
    )


def made(result: dict[str, Any]) -> str:
    """Date and machine."""
    machine = result["machine"]
    return f"Measured on {result['date']}, {machine['processor']}, {machine['cores']} cores."


def main(words: list[str]) -> None:
    """Write the part of the page; takes no words."""
    write_marked(PAGE, parts(), "reliability")
