"""Tables of docs/guides/run_folder.md from the results of the campaigns of `MAKERS`."""

from functools import partial
from typing import Any

from pages.store.marks import read_json
from pages.store.program import RESULTS, Program
from pages.store.tables import noted

MAKERS = {
    "faults": "python tests/faults/campaign.py --kills 50 --json docs/results/faults.json",
    "fuzz": "python tests/fuzz/campaign_of_inputs.py --json docs/results/fuzz.json",
    "soak": "python tests/faults/soak.py --json docs/results/soak.json --plot docs/results/soak.png",
    "large": "python tests/faults/large.py --json docs/results/large.json",
}


def faults(result: dict[str, Any]) -> str:
    """One row per fault."""
    rows = [[r["fault"], f"{r['as_promised']} of {r['trials']}", r["what"]] for r in result["faults"]]
    return noted(("Fault", "As promised", "What happens"), rows, made(result))


def fuzz(result: dict[str, Any]) -> str:
    """One row per reader, and the sum."""
    readers = result["readers"]
    keys = ("inputs", "seconds", "findings")
    rows = [[r["reader"], *(str(r[key]) for key in keys)] for r in readers]
    rows.append(["together", *(str(sum(r[key] for r in readers)) for key in keys)])
    bound = f"Memory bound: {result['memory'] >> 20} MiB above the start. {made(result)}"
    return noted(("Reader", "Inputs", "Seconds", "Findings in this run"), rows, bound)


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


def part(name: str) -> str:
    """The part of one campaign."""
    file, write = RESULTS / f"{name}.json", {"faults": faults, "fuzz": fuzz, "soak": soak, "large": large}[name]
    if not file.exists():
        return f"No result is stored yet; the command is `{MAKERS[name]}`."
    return write(read_json(file, MAKERS[name]))


PROGRAM = Program(__name__, "guides/run_folder.md", {name: partial(part, name) for name in MAKERS})
