"""`docs/make.py bench measure peers`: gsplat's pure-torch reference on the same arrays in the same run.

One view of the common workload without time: colour and depth forward, then the gradients of a fixed random
combination of the two images, one renderer after the other in one process. A substitute computes the lists of pairs,
for which gsplat has a CUDA kernel. Its time is shown separately and is not part of the time of gsplat.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import ModuleType
from typing import Any
from unittest.mock import patch

import numpy as np

from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.studies.bench.case import BenchCase, Precision, apart
from endotsr.studies.bench.clock import repeated, spread
from endotsr.training.scene import workload

Found = tuple[dict[str, FloatArray], list[float]]

OURS_REPEATS = 11
WARM_UP = BenchCase(100, 48, 32)
LIMITS = {"float32": 1e-3, "float64": 1e-9}  # largest relative error, norm against norm, of an image or a gradient
PIP_LINES = (
    "pip install torch --index-url https://download.pytorch.org/whl/cpu",
    "pip install 'gsplat>=1.5,<2' --no-deps",
)


def measure_peers(
    gaussians: Sequence[int], precisions: Sequence[Precision], threads: int, repeats: int
) -> dict[str, Any]:
    """{"cases": of `compare`}. Raises: InputError with the pip commands if torch or gsplat is missing."""
    from pages.bench.gsplat import available

    reason = apart(available)  # torch is not imported in this process
    if reason is not None:
        raise InputError(f"bench peers needs torch and gsplat ({reason}); install with: {'; '.join(PIP_LINES)}")
    cases = [BenchCase(n, precision=p, threads=threads, repeats=repeats) for n in gaussians for p in precisions]
    return {"cases": [apart(compare, case) for case in cases]}


def compare(case: BenchCase) -> dict[str, Any]:
    """Both renderers on one view. Call it through `apart`.

    returns  "ours", "gsplat", "pair_lists": spreads of forward and reverse together; "ratio" of the medians without
             the lists; "errors" {"colour", "depth", gradients by name}: |gsplat - ours| / |ours| in the 2-norm;
             "versions", and the sizes of the case
    """
    import importlib.metadata

    import numba
    import torch  # pyright: ignore[reportMissingImports]

    numba.set_num_threads(min(case.threads, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]
    torch.set_num_threads(case.threads)
    view = _view(case)
    ours, our_seconds = _ours(*view)
    _theirs(_view(WARM_UP), 1)  # torch is initialised at first use
    theirs, seconds, lists = _theirs(view, case.repeats)
    return {
        "gaussians": case.gaussians,
        "width": case.width,
        "height": case.height,
        "precision": case.precision,
        "threads": case.threads,
        "ours": spread(our_seconds),
        "gsplat": spread(seconds),
        "pair_lists": spread(lists),
        "ratio": float(np.median(seconds) / np.median(our_seconds)),
        "errors": {name: relative_error(array, ours[name]) for name, array in theirs.items()},
        "versions": {name: importlib.metadata.version(name) for name in ("torch", "gsplat")},
    }


def _view(case: BenchCase) -> tuple[Any, ...]:
    """Scene, camera, settings and the gradients of a loss with respect to colour and depth."""
    from endotsr.method.splatting.render import Scene
    from endotsr.training.fitting.model import raster_settings

    config = case.config()
    made = workload.gaussians(case.gaussians, config)
    scene = Scene(made.position, made.quaternion, made.log_scale, made.opacity_logit, made.harmonics)
    rng, shapes = np.random.default_rng(3), ((3, case.height, case.width), (case.height, case.width))
    adjoint = [rng.normal(size=shape).astype(case.precision) for shape in shapes]
    return scene, workload.camera(case.width, case.height), raster_settings(config), *adjoint


def _ours(scene: Any, camera: Any, settings: Any, d_colour: FloatArray, d_depth: FloatArray) -> Found:
    """Images and gradients by name, and the seconds of each repeat."""
    from endotsr.method.splatting.render import render_forward, render_reverse

    found: dict[str, FloatArray] = {}

    def once() -> None:
        out, saved = render_forward(scene, camera, settings)
        grads = render_reverse(d_colour, d_depth, None, saved)
        found.update(colour=out.colour, depth=out.depth)
        found.update(
            {name: getattr(grads, f"d_{name}") for name, array in scene._asdict().items() if array is not None}
        )

    return found, repeated(once, OURS_REPEATS, warm_up=2)


def _theirs(view: tuple[Any, ...], repeats: int) -> tuple[dict[str, FloatArray], list[float], list[float]]:
    """Images and gradients by name, the seconds of each repeat without the pair lists, and the seconds of the lists."""
    from pages.bench import gsplat as bench_gsplat

    seconds, lists, found = [], [], {}
    for _ in range(repeats):
        with _list_seconds(bench_gsplat) as spent:
            began = time.perf_counter()
            render = bench_gsplat.render_with_gradients(*view)
            seconds.append(time.perf_counter() - began - sum(spent))
        lists.append(sum(spent))
        found = {"colour": render.colour, "depth": render.depth} | render.gradients
    return found, seconds, lists


@contextmanager
def _list_seconds(peer: ModuleType) -> Iterator[list[float]]:
    """The seconds of the substitute for the pair lists within the block."""
    spent: list[float] = []
    pair_list = peer.pair_list

    def timed(*arguments: Any) -> Any:
        began = time.perf_counter()
        made = pair_list(*arguments)
        spent.append(time.perf_counter() - began)
        return made

    with patch.object(peer, "pair_list", timed):
        yield spent


def relative_error(found: FloatArray, expected: FloatArray) -> float:
    """|found - expected| / |expected| in the 2-norm over all entries, formed in float64."""
    difference = np.linalg.norm(found.astype(np.float64) - expected)
    size = float(np.linalg.norm(expected.astype(np.float64)))
    return float(difference) / size if size > 0 else float(difference)


def verdict(case: dict[str, Any]) -> str:
    """The largest error, its array, and whether it is within the limit of the precision."""
    worst = max(case["errors"], key=lambda name: case["errors"][name])
    error, limit = case["errors"][worst], LIMITS[case["precision"]]
    return f"{error:.1e} ({worst}), {'within' if error <= limit else 'BEYOND'} {limit:.0e}"
