"""The cost of a looser stop: `python docs/make.py tradeoff.stop measure` trains two models and renders with all stops.

`python docs/make.py tradeoff` writes the sentences to docs/tradeoff.md.
"""

import argparse
from typing import Any

import msgspec
import numpy as np

import endotsr
from endotsr.results.evaluation.metrics import psnr_tissue
from endotsr.training.fitting.model import render_at
from pages.store.program import Program
from pages.store.tables import where

TRAINED, RENDERED = (1e-3, 1e-2), (1e-2, 1e-3, 1e-6)
SCENE = {"width": 96, "height": 76, "frames": 24}
POINTS = {"first_frame_points": 3000, "other_frame_points": 750}
ITERATIONS = 400


def measured(options: argparse.Namespace) -> dict[str, Any]:
    """Mean PSNR over the tissue of the held-out frames, dB: stop of the training -> stop of the render -> value."""
    clip, found = endotsr.load_sequence("simulated", simulator=SCENE), {}
    for trained in TRAINED:
        settings: dict[str, Any] = {"raster": {"transmittance_stop": trained}, "initialisation": POINTS}
        model = endotsr.train(clip, endotsr.make_config("demo", iterations=ITERATIONS, **settings)).model
        found[f"{trained:g}"] = row = {}
        for rendered in RENDERED:
            raster = msgspec.structs.replace(model.config.raster, transmittance_stop=rendered)
            config, values = msgspec.structs.replace(model.config, raster=raster), []
            for k in map(int, clip.test_index):
                out = render_at(model.gaussians, model.spectral, config, clip.cameras[k], float(clip.times[k]))
                values.append(psnr_tissue(np.clip(out.colour, 0, 1), clip.frame(k).image, clip.masks[k]))
            row[f"{rendered:g}"] = float(np.mean(values))
    return {"psnr_tissue": found}


def sentences(result: dict[str, Any]) -> str:
    """The cost of the loose stop in the render and in the training."""
    tight, loose = (result["psnr_tissue"][f"{trained:g}"] for trained in TRAINED)
    first, _, last = (f"{rendered:g}" for rendered in RENDERED)
    scene = f"{SCENE['width']}x{SCENE['height']}, {SCENE['frames']} frames, {ITERATIONS} iterations of `demo`, one seed"
    return (
        f"On a small simulated scene ({scene}; {where(result)}), a model that was trained with a stop of "
        f"{TRAINED[0]:g} has {tight[last]:.2f} dB on held-out tissue when it is rendered with {last}, and "
        f"{tight[first]:.2f} dB with {first}. One that was trained with {TRAINED[1]:g} has {loose[last]:.2f} dB and "
        f"{loose[first]:.2f} dB. Of its loss, {tight[last] - loose[last]:.1f} dB are in the trained Gaussians and "
        f"{loose[last] - loose[first]:.1f} dB in the render."
    )


PROGRAM = Program(__name__, record="stop.json", measure=measured)
