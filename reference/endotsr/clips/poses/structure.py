"""Structure from motion by pycolmap: poses and points from pictures and tissue, without depth.

In: `Views`; their depth is not read. Out: `Structure`, in a unit of its own: the median depth of its points is 1. The
intrinsics are held fixed, and a feature is used where its pixel is usable (`usable_pixels`). Everything runs on one
thread with fixed seeds, so that one machine repeats its result; another version of pycolmap or another processor may
find other features. The largest of several models is taken. pycolmap is imported here and nowhere else.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from endotsr.clips.opencv.png import write_png
from endotsr.clips.poses.chain import LONGEST_GAP
from endotsr.clips.poses.views import Views, compose, inverse, usable_pixels
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import FloatArray
from endotsr.method.splatting.camera import CameraPose

REGISTERED = 0.8  # ruling: share of the frames that has to have a pose of its own
LEAST_MODEL = 3  # pictures of a model
MOST_MODELS = 10
EXHAUSTIVE = 100  # frames of which every pair is matched: 4950 pairs
OVERLAP = 20  # of more frames: neighbours with which a frame is matched, besides those 1, 2, 4, ... frames later
SEED = 0
MISSING = "structure from motion needs pycolmap: pip install 'endotsr[sfm]'"


class Structure(NamedTuple):
    """n poses, and m points that two or more frames see."""

    poses: list[CameraPose | None]  # world to camera; the first one is the identity; None: not registered
    points: FloatArray  # (m, 3) world positions
    seen: list[NDArray[np.intp]]  # per frame, the rows of `points` that it sees
    pixels: list[FloatArray]  # per frame, (k, 2) columns and rows where it sees them; pixel edges at integers
    error: float  # mean distance in pixels between these places and the projected points
    others: list[int]  # pictures of each model that was not taken

    @property
    def without(self) -> list[int]:
        """Frames without a pose."""
        return [k for k, pose in enumerate(self.poses) if pose is None]

    def depth(self, k: int) -> FloatArray:
        """View-space z of the points that frame k sees; empty without a pose."""
        pose = self.poses[k]
        return np.zeros(0) if pose is None else (self.points[self.seen[k]] @ pose.rotation.T + pose.translation)[:, 2]

    def scaled(self, factor: float) -> "Structure":
        """The same with all lengths times `factor`."""
        poses = [pose and CameraPose(pose.rotation, factor * pose.translation) for pose in self.poses]
        return self._replace(poses=poses, points=factor * self.points)


def reconstructed(views: Views, on_frame: Callable[[], object] = lambda: None) -> Structure | None:
    """The structure of the largest model; None without a model.

    on_frame  called after each registered frame

    Raises:  InputError without pycolmap.
    """
    try:
        import pycolmap  # type: ignore[import-not-found]  # the extra `sfm`
    except ImportError:
        raise InputError(MISSING) from None
    pycolmap.logging.minloglevel = 3  # a clip without a model is an answer
    with tempfile.TemporaryDirectory() as place:
        _write(views, Path(place))
        models = _mapped(pycolmap, Path(place), views, on_frame)
        found = sorted(models.values(), key=lambda model: model.num_reg_images(), reverse=True)
        if not found or found[0].num_reg_images() < LEAST_MODEL:
            return None
        return _in_own_unit(_read(found[0], views.count, [model.num_reg_images() for model in found[1:]]))


def refuse_too_few(found: Structure) -> None:
    """Raises InputError if fewer than `REGISTERED` of the frames have a pose, or more than `LONGEST_GAP` in a row lack
    one; the gap counts before the first and after the last pose too."""
    count, without = len(found.poses), found.without
    gap, longest = [-1, -1], [0, -1]
    for k in without:
        gap = [gap[0], k] if gap[1] == k - 1 and gap[0] >= 0 else [k, k]
        longest = max(longest, gap, key=lambda ends: ends[1] - ends[0])
    length = longest[1] - longest[0] + 1
    said = f"{count - len(without)} of {count} frames are registered"
    if found.others:
        said += f"; further models, which share no scale with it, have {', '.join(map(str, found.others))} frames"
    remedy = "cut the clip with endotsr prepare --frames, or use more of its resolution or frame rate"
    if length > LONGEST_GAP:
        raise InputError(
            f"{said}; frames {longest[0]} to {longest[1]} have no pose: {length} in a row, and {LONGEST_GAP} are"
            f" bridged at most; {remedy}"
        )
    if count - len(without) < REGISTERED * count:
        raise InputError(f"{said}; use at least {REGISTERED:.0%}; {remedy}")


def _write(views: Views, root: Path) -> None:
    """The pictures, and masks whose white pixels may be used."""
    for name in ("images", "masks", "out"):
        (root / name).mkdir()
    for k in range(views.count):
        usable = usable_pixels(views.images[k], views.tissue[k])
        write_png(root / "images" / _name(k), np.ascontiguousarray(views.images[k].transpose(1, 2, 0)))
        write_png(root / "masks" / f"{_name(k)}.png", np.where(usable, 255, 0).astype(np.uint8))


def _name(k: int) -> str:
    return f"{k:06d}.png"


def _mapped(pycolmap: Any, root: Path, views: Views, on_frame: Callable[[], object]) -> dict[int, Any]:
    """The models that pycolmap reconstructs."""
    c, database = views.camera, root / "database.db"
    reader = pycolmap.ImageReaderOptions(
        camera_model="PINHOLE", camera_params=f"{c.fx!r},{c.fy!r},{c.cx!r},{c.cy!r}", mask_path=str(root / "masks")
    )
    extraction, matching = pycolmap.FeatureExtractionOptions(), pycolmap.FeatureMatchingOptions()
    verification = pycolmap.TwoViewGeometryOptions()
    extraction.use_gpu = matching.use_gpu = False
    extraction.num_threads = matching.num_threads = 1
    verification.ransac.random_seed = SEED
    pycolmap.set_random_seed(SEED)
    pycolmap.extract_features(
        database, root / "images", reader_options=reader, extraction_options=extraction,
        camera_mode=pycolmap.CameraMode.SINGLE,
    )  # fmt: skip
    common = {"matching_options": matching, "verification_options": verification}
    if views.count <= EXHAUSTIVE:
        pycolmap.match_exhaustive(database, **common)
    else:
        pairs = pycolmap.SequentialPairingOptions(overlap=OVERLAP, quadratic_overlap=True, num_threads=1)
        pycolmap.match_sequential(database, pairing_options=pairs, **common)
    return pycolmap.incremental_mapping(
        database, root / "images", root / "out", options=_mapping(pycolmap), next_image_callback=on_frame
    )


def _mapping(pycolmap: Any) -> Any:
    """Options of the reconstruction: one thread, fixed seeds, intrinsics held fixed."""
    options = pycolmap.IncrementalPipelineOptions(
        min_model_size=LEAST_MODEL, max_num_models=MOST_MODELS, extract_colors=False, num_threads=1, random_seed=SEED,
        ba_refine_focal_length=False, ba_refine_principal_point=False, ba_refine_extra_params=False,
    )  # fmt: skip
    options.mapper.abs_pose_refine_focal_length = options.mapper.abs_pose_refine_extra_params = False
    options.mapper.num_threads, options.mapper.random_seed = 1, SEED
    options.triangulation.random_seed = SEED
    return options


def _read(model: Any, count: int, others: list[int]) -> Structure:
    """The poses and points of a model, with the first registered camera as the world."""
    rows = {number: row for row, number in enumerate(sorted(model.points3D))}
    points = np.array([model.points3D[number].xyz for number in rows]).reshape(-1, 3)
    poses: list[CameraPose | None] = [None] * count
    seen = [np.zeros(0, np.intp)] * count
    pixels: list[FloatArray] = [np.zeros((0, 2))] * count
    for image in model.images.values():
        if not image.has_pose:
            continue
        k, placed = int(Path(image.name).stem), image.cam_from_world().matrix()
        poses[k] = CameraPose(np.ascontiguousarray(placed[:, :3]), np.ascontiguousarray(placed[:, 3]))
        features = [feature for feature in image.points2D if feature.has_point3D()]
        seen[k] = np.array([rows[feature.point3D_id] for feature in features], np.intp)
        pixels[k] = np.array([feature.xy for feature in features]).reshape(-1, 2)
    first = next(pose for pose in poses if pose is not None)
    points = points @ first.rotation.T + first.translation
    poses = [pose and compose(pose, inverse(first)) for pose in poses]
    return Structure(poses, points, seen, pixels, float(model.compute_mean_reprojection_error()), others)


def _in_own_unit(found: Structure) -> Structure:
    """The structure with a median depth of 1."""
    return found.scaled(1 / float(np.median(np.concatenate([found.depth(k) for k in range(len(found.poses))]))))
