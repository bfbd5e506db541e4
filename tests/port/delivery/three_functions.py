"""A port of three functions, (1) frequencies, (3) and (B13), as somebody begins one: `three_functions.py IN OUT`.

It imports nothing of the package. `reading` and `generator` are level 0, with which every port begins.
"""

import json
import sys
from pathlib import Path

import numpy as np


def fnv1a(text):
    h = 0xCBF29CE484222325
    for byte in text.encode():
        h = (h ^ byte) * 0x100000001B3 % 2**64
    return h


def word(seed, k):
    z = (seed + (k + 1) * 0x9E3779B97F4A7C15) % 2**64
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 % 2**64
    z = (z ^ z >> 27) * 0x94D049BB133111EB % 2**64
    return z ^ z >> 31


def generator(_, settings):
    found = [word(fnv1a(settings["seed"]), k) for k in range(settings["count"])]
    return {"words": np.array(found, np.uint64), "unit_numbers": np.array([(w >> 40) / 2**24 for w in found])}


def reading(inputs, settings):
    array, mask = inputs["harmonics"], inputs["mask"]
    height, width = mask.shape
    return {
        "column": array[:, :, settings["gaussian"]].copy(), "flat": array.reshape(-1), "scalar": inputs["scalar"],
        "empty": inputs["empty"], "tissue_pixels": np.array(mask.sum()),
        "tissue_row": np.flatnonzero(mask[settings["row"]]),
        "sample_x": np.arange(width) + 0.5, "sample_y": np.arange(height) + 0.5,
    }  # fmt: skip


def frequencies(_, settings):
    count, low, high = (settings[key] for key in ("count", "low", "high"))
    return {"omega": np.array([low * (high / low) ** (k / (count - 1)) if count > 1 else low for k in range(count)])}


def motion(inputs, _):
    c, phi, d = inputs["motion_coefficients"], inputs["phi"], inputs["d_translation"]
    return {
        "translation": (c * phi[:, None]).sum(axis=1),
        "d_motion_coefficients": d[:, None] * phi[:, None],
        "d_phi": (d[:, None] * c).sum(axis=(0, 2)),
    }


def exposure(inputs, _):
    gain, d = np.exp(inputs["log_gain"])[:, None, None], inputs["d_exposed"]
    return {
        "exposed": gain * inputs["colour"] + inputs["bias"][:, None, None],
        "d_colour": gain * d,
        "d_log_gain": (gain * d * inputs["colour"]).sum(axis=(1, 2)),
        "d_bias": d.sum(axis=(1, 2)),
    }


PORTED = {f.__name__: f for f in (reading, generator, frequencies, motion, exposure)}


def main(requests, outputs):
    head, omitted = json.loads((requests / "requests.json").read_text()), set()
    for name in head["cases"]:
        request = json.loads((requests / name / "request.json").read_text())
        if request["operation"] not in PORTED:
            omitted.add(request["operation"])
            continue
        inputs = {key: np.load(requests / name / file) for key, file in request["inputs"].items()}
        inputs = {key: a.astype(head["precision"]) if a.dtype.kind == "f" else a for key, a in inputs.items()}
        (outputs / name).mkdir(parents=True)
        for key, value in PORTED[request["operation"]](inputs, request["settings"]).items():
            real = value.dtype.kind == "f"
            np.save(outputs / name / f"{key}.npy", np.asarray(value, head["precision"]) if real else value)
    (outputs / "not_ported.txt").write_text("\n".join(sorted(omitted)))


main(*map(Path, sys.argv[1:]))
