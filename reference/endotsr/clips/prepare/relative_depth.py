"""Depth of a monocular clip: relative inverse depth of a network, or a plane.

A monocular network outputs values r that increase towards the camera: 1 / z = scale r + shift with unknown scale > 0
and shift. They are fitted to existing depth of the clip, such as the points of a reconstruction or stereo matches, per
frame or once for the sequence. Without existing depth they are assumed: the farthest tissue is `farthest` times as far
as the nearest, with one line for the sequence. The scale is then free, because the depth loss normalises depth by its
maximum (B8). The shift is an assumption about the shape.

In: a folder in the common format and files of r, one per frame. Out: depth frame by frame, and a sentence on the
assumptions.
"""

import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.choices import Align
from endotsr.clips.formats.files import shortened
from endotsr.clips.sequences.checks.depth import light_correlation, light_finding
from endotsr.clips.sequences.clip import Assumed, Clip
from endotsr.clips.sequences.depth_files import read_plane
from endotsr.clips.sequences.smaller import resized_nearest
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

FEWEST, MOST = 20, 400  # pixels with both values: needed for a line, and used for its robust estimate
SPREAD = 3 * 1.4826  # median absolute residuals; pixels beyond are excluded from the last fit
EXTREMES = (1.0, 99.0)  # percentiles of r for the farthest and the nearest tissue
LOOKED_AT = 8  # frames whose light is checked


class StraightLine(NamedTuple):
    """1 / z = scale r + shift."""

    scale: float
    shift: float

    def depth(self, relative: FloatArray, farthest: float = np.inf) -> NDArray[np.float32]:
        """z (H, W) of r (H, W); 0 = none, where r is not finite or the inverse depth is not positive.

        farthest   if finite, z is clipped to [1, farthest], and an inverse depth that is not positive gives `farthest`
        """
        inverse = np.where(np.isfinite(relative), self.scale * relative + self.shift, np.nan)
        if np.isfinite(farthest):
            inverse = np.clip(inverse, 1 / farthest, 1)
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            depth = (1.0 / inverse).astype(np.float32)
        return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


class MadeDepth(NamedTuple):
    """Depth ready to be written."""

    frames: Iterator[NDArray[np.float32]]  # (H, W) each, 0 = none
    method: str  # for sequence.toml
    assumed: Assumed
    note: str = ""  # how the files belong to the frames, where this deserves a line


def fitted_line(relative: FloatArray, depth: FloatArray) -> StraightLine | None:
    """The line of 1 / z over r, robust against outliers in both.

    relative, depth   (H, W) or (n,); pixels with r not finite or z = 0 are ignored

    The fit uses repeated medians (half of the pixels may be wrong), then least squares over the pixels near that line.

    Edges:  fewer than `FEWEST` pixels, or one r everywhere, give None.
    """
    from scipy.stats import siegelslopes

    both = np.isfinite(relative) & (depth > 0)
    x, y = relative[both].astype(np.float64), 1.0 / depth[both].astype(np.float64)
    if len(x) < FEWEST or np.ptp(x) == 0:
        return None
    step = -(-len(x) // MOST)
    middle = siegelslopes(y[::step], x[::step])
    rough = StraightLine(float(middle[0]), float(middle[1]))  # type: ignore[arg-type]
    residual = np.abs(y - rough.scale * x - rough.shift)
    near = residual <= SPREAD * np.median(residual)
    if np.ptp(x[near]) == 0:
        return rough
    scale, shift = np.polyfit(x[near], y[near], 1)
    return StraightLine(float(scale), float(shift))


def relative_depth(
    clip: Clip, source: Path, files: list[Path], align: Align, farthest: float, trusted: bool
) -> MadeDepth:
    """Depth of every frame from the files of r in the folder `source`.

    files      one per frame
    align      one line per frame or for the sequence; auto: per frame if the clip has depth, else for the sequence
    farthest   ratio of the farthest to the nearest depth; used only if the clip has no depth
    trusted    skip the comparison with the light

    Raises:  InputError for values that decrease towards the camera, and, without existing depth, for moving poses or a
             stereo pair, which fix a scale that r lacks.
    """
    intrinsics = clip.intrinsics
    assert intrinsics is not None

    def relative(i: int) -> FloatArray:
        return resized_nearest(read_plane(files[i]).astype(np.float64), intrinsics.width, intrinsics.height, files[i])

    if clip.depth and not clip.depth.assumed:
        return _aligned(clip, relative, source, align)
    _refuse_known_scale(clip)
    every = range(len(files))
    groups = [[i] for i in every] if align == "frame" else [list(every)] * len(files)
    lines = {tuple(group): _assumed_line(relative, group, farthest, source) for group in groups}
    chosen = [lines[tuple(group)] for group in groups]
    if not trusted:
        _refuse_against_light(clip, relative, chosen, source)
    how = "in every frame" if align == "frame" else "in the sequence"
    method = f"relative inverse depth of {source.name}; assumed: the farthest tissue {how} is {farthest:g} times as far"
    frames = (line.depth(relative(i), farthest) for i, line in enumerate(chosen))
    return MadeDepth(frames, f"{method} as the nearest", "scale and shift")


def flat_depth(clip: Clip) -> MadeDepth:
    """A fronto-parallel plane in every frame. Raises InputError if moving poses or a stereo pair determine depth."""
    _refuse_known_scale(clip)
    assert clip.intrinsics is not None
    plane = np.ones((clip.intrinsics.height, clip.intrinsics.width), np.float32)
    return MadeDepth((plane for _ in clip.names), "assumed: a plane that faces the camera", "shape")


def _aligned(clip: Clip, relative: Callable[[int], FloatArray], source: Path, align: Align) -> MadeDepth:
    """Depth by lines fitted to the depth of the clip."""
    known = clip.depth
    assert known is not None
    count, apart = clip.count, []
    reference = [_sampled(relative(i), known(i), MOST if align != "sequence" else 50) for i in range(count)]
    once = fitted_line(*np.concatenate(reference, axis=1)) if align == "sequence" else None
    lines = [once if align == "sequence" else fitted_line(*pair) for pair in reference]
    fitted = [i for i, line in enumerate(lines) if line is not None]
    if not fitted:
        raise InputError(f"{source}: no frame has {FEWEST} pixels with depth in {clip.where} to compare with")
    chosen = [lines[min(fitted, key=lambda k: (abs(k - i), k))] for i in range(count)]
    for i, line in enumerate(chosen):
        assert line is not None
        if line.scale <= 0:
            raise InputError(
                f"{source}: frame {clip.names[i]}: the values decrease towards the camera, according to"
                f" the depth of {clip.where.name}; use a relative inverse depth, larger = nearer{_of_wrong_depth(clip)}"
            )
        found, z = line.depth(reference[i][0]), reference[i][1]
        apart.append(np.abs(found - z)[z > 0] / z[z > 0])
    borrowed = [clip.names[i] for i in range(count) if i not in fitted]
    how = "once for the sequence" if align == "sequence" else "in every frame"
    method = (
        f"relative inverse depth of {source.name}, scale and shift from the depth before ({known.method})"
        f" {how}; median difference {np.median(np.concatenate(apart)):.1%}"
    ) + (f"; scale and shift of the nearest frame for {shortened(borrowed)}" if borrowed else "")
    frames = (line.depth(relative(i)) for i, line in enumerate(chosen) if line is not None)
    return MadeDepth(frames, method, known.assumed)


def _of_wrong_depth(clip: Clip) -> str:
    """The end of a message where the light contradicts the depth that the clip has, with what removes it."""
    assert clip.depth is not None
    if not (found := light_finding(_light(clip, clip.depth), str(clip.where))):
        return ""
    return (
        f"; but {found[0].what}: the depth of {clip.where.name} may be the wrong one: prepare the clip again without"
        " depth, and repeat the command"
    )


def _light(clip: Clip, depth: Callable[[int], FloatArray | None]) -> list[float]:
    """`light_correlation` of the first `LOOKED_AT` frames that have a depth."""
    looked, found = list(range(min(LOOKED_AT, clip.count))), []
    for i, pair in zip(looked, clip.pictures(looked)):
        if (plane := depth(i)) is not None:
            found.append(light_correlation(pair.left, plane, clip.masks(i) if clip.masks else None))
    return found


def _sampled(relative: FloatArray, depth: NDArray[np.float32] | None, most: int) -> FloatArray:
    """A sample of the pixels with both r and z, (2, k)."""
    if depth is None:
        return np.zeros((2, 0))
    both = np.flatnonzero(np.isfinite(relative) & (depth > 0))
    both = both[:: max(1, len(both) // most)]
    return np.stack([relative.reshape(-1)[both], depth.reshape(-1)[both]])


def _refuse_known_scale(clip: Clip) -> None:
    """Raises InputError if a stereo pair or moving poses fix the scale."""
    poses = [pose for pose in clip.poses or [] if pose is not None]
    if clip.right and clip.baseline:
        raise InputError(
            f"{clip.where}: a stereo pair gives lengths; use `endotsr depth {shlex.quote(str(clip.where))}` first"
        )
    if moves(poses):
        raise InputError(
            f"{clip.where}: the camera moves, and its poses fix the scale of the depth, which relative numbers do"
            " not have; use a clip with some depth, such as that of the points of a COLMAP model (`endotsr prepare"
            " MODEL --points sparse`) or of `endotsr poses --sfm`"
        )


def moves(poses: list[CameraPose]) -> bool:
    """Whether the poses fix a scale: one has another translation than the first."""
    return any((pose.translation != poses[0].translation).any() for pose in poses)


def _assumed_line(
    relative: Callable[[int], FloatArray], group: list[int], farthest: float, source: Path
) -> StraightLine:
    """The line that maps the nearest tissue of these frames to 1 and the farthest to `farthest`."""
    samples = [values[np.isfinite(values)][::37] for values in map(relative, group)]
    low, high = np.percentile(np.concatenate(samples) if any(map(len, samples)) else [0.0], EXTREMES)
    if not high > low:
        raise InputError(f"{source}: all values are {low:g}; use a relative inverse depth")
    scale = (1 - 1 / farthest) / (high - low)
    return StraightLine(float(scale), float(1 - scale * high))


def _refuse_against_light(
    clip: Clip, relative: Callable[[int], FloatArray], lines: list[StraightLine], source: Path
) -> None:
    if light_finding(_light(clip, lambda i: lines[i].depth(relative(i))), str(source)):
        raise InputError(
            f"{source}: the values are large where the pictures are dark, but near tissue is bright; use a"
            " relative inverse depth, larger = nearer, or --trust-depth for a light source off the scope"
        )
