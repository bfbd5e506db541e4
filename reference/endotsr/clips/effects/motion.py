"""Tissue motion: none, rigid, periodic or irregular.

The flow of a tile counts as motion if its root mean square over time exceeds both `LEAST_MOTION` pixels and
`NULL_FACTOR` times the flow caused by noise in that tile, in at least `LEAST_TILES` tiles and `TILE_FRACTION` of them.
For a moving camera, the flow of the best-fitting rigid scene is removed first, `RIGID_ERROR` of its size is added to
the limit, tiles next to excluded pixels are ignored, and the round-trip error of the flow counts as noise (rigid.py).
"""

import numpy as np

from endotsr.clips.effects.frames import TILE, ReducedFrames, residual, slow_courses, tile_map, without_gaps
from endotsr.clips.effects.noise import Noise
from endotsr.clips.effects.periodic import Line, spectral_lines
from endotsr.clips.effects.rigid import fit_rigid
from endotsr.clips.effects.tracks import FlowTracks
from endotsr.clips.effects.verdict import UNKNOWN, Curve, EffectVerdict, Map
from endotsr.clips.sequences.sequence import Sequence
from endotsr.method.kernels.arrays import FloatArray

NULL_FACTOR = 2.0
LEAST_MOTION = 0.05  # pixels of the full size
RIGID_ERROR = 0.25  # fraction of the camera flow that pose errors and moving light may leave
LEAST_TILES = 2
TILE_FRACTION = 0.02
EXPLAINED = 0.99  # fraction of the squared motion that the counted half waves explain
AFFINE_FRACTION = 0.98  # of the squared flow; above it, the picture moves as a whole
FALSE_POSITIVES = 0.01  # designed rate, for all tiles together


def motion_verdict(
    sequence: Sequence, clip: ReducedFrames, tracks: FlowTracks, noise: Noise
) -> tuple[EffectVerdict, list[Line]]:
    """The verdict on tissue motion, and the lines of its spectrum (empty without periodic motion)."""
    null, clear, camera = tracks.null, np.ones_like(tracks.usable), np.zeros_like(tracks.tiles)
    if not sequence.static_camera:
        rigid = fit_rigid(clip, tracks, noise)
        null, clear, camera = np.maximum(null, rigid.error), rigid.clear, rigid.flow
    tiles = tracks.tiles - camera
    moving = tracks._replace(tiles=tiles, usable=tracks.usable & clear)
    size = _root_mean_square(tiles)
    limit = np.maximum(NULL_FACTOR * null, LEAST_MOTION) + RIGID_ERROR * _root_mean_square(camera)
    ratio = np.where(moving.usable, size / limit, 0.0)
    needed = max(LEAST_TILES, round(TILE_FRACTION * int(moving.usable.sum())))
    if int(moving.usable.sum()) < needed:
        return _verdict(UNKNOWN, 1.0, clip, moving, size, [], clip.count), []
    statistic = float(np.sort(ratio)[-needed])
    if statistic < 1.0:
        return _verdict("none", statistic, clip, moving, size, [], 0), []
    filled = without_gaps(moving.tiles[:, :, moving.usable], clip.times)
    waves = half_waves(filled, clip.times, null[moving.usable])
    lines = spectral_lines(filled, clip.times, clip.frames, null[moving.usable])
    kind = "periodic" if lines else "rigid" if _affine_fraction(filled, clip, moving) > AFFINE_FRACTION else "irregular"
    return _verdict(kind, statistic, clip, moving, size, lines, waves), lines


def half_waves(filled: FloatArray, times: FloatArray, null: FloatArray) -> int:
    """The smallest number of half waves over the clip that explains 99 % of the motion, after subtracting noise."""
    flat = filled.reshape(len(times), -1) - filled.mean(axis=0).ravel()
    noise, total = len(times) * float((null**2).sum()), float((flat**2).sum())
    for count in range(1, len(times)):
        rest = float((residual(slow_courses(times, count + 1), flat) ** 2).sum())
        if rest <= (1 - EXPLAINED) * total + noise * (1 - count / len(times)):
            return count
    return len(times)


def _root_mean_square(tiles: FloatArray) -> FloatArray:
    """RMS over the frames that see a tile, (m, 2, T) to (T,); 0 for a tile that no frame sees."""
    squares = (tiles**2).sum(axis=1)
    known = np.isfinite(squares)
    return np.sqrt(np.where(known, squares, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1))


def _affine_fraction(filled: FloatArray, clip: ReducedFrames, tracks: FlowTracks) -> float:
    """Fraction of the squared flow explained by an affine map of each frame."""
    rows, columns = clip.images.shape[2] // TILE, clip.images.shape[3] // TILE
    place = np.indices((rows, columns)).reshape(2, -1)[:, tracks.usable]
    design = np.stack([np.ones(place.shape[1]), *place], axis=1)
    flat = filled.reshape(-1, place.shape[1]).T
    return 1.0 - float((residual(design, flat) ** 2).sum() / max((flat**2).sum(), 1e-30))


def _verdict(kind: str, statistic: float, clip: ReducedFrames, tracks: FlowTracks, size: FloatArray, lines: list[Line],
             waves: int) -> EffectVerdict:  # fmt: skip
    length = np.sqrt((tracks.tiles**2).sum(axis=1))
    seen = np.isfinite(length)
    path = np.where(seen, length, 0.0).sum(axis=1) / np.maximum(seen.sum(axis=1), 1)
    largest = float(size[tracks.usable].max(initial=0.0))
    rates = ", ".join(f"{line.cycles:.2g}" for line in lines)
    reason = {
        UNKNOWN: "Too few tiles of tissue are seen to tell; motion is assumed.",
        "none": f"No tile moves by more than noise would show ({statistic:.2f} of the threshold).",
        "rigid": f"Tissue moves by up to {largest:.2g} px (RMS), all of it along one affine map of the picture.",
        "periodic": f"Tissue moves by up to {largest:.2g} px (RMS), with {rates} cycles per sequence.",
        "irregular": f"Tissue moves by up to {largest:.2g} px (RMS), and no rate stands out in the spectrum.",
    }[kind]
    height, width = clip.images.shape[2:]
    return EffectVerdict(
        "motion", kind != "none", kind, statistic, 1.0, "times the threshold of a tile",
        "root mean square of the flow of a tile over max(2 x flow of noise alone, 0.05 px)",
        FALSE_POSITIVES, reason, {"largest_px": largest, "half_waves": waves},
        Curve("mean flow, px", "time", clip.times, {"flow": path}),
        Map("flow, RMS over time, px", tile_map(np.where(tracks.usable, size, np.nan), height, width)),
    )  # fmt: skip
