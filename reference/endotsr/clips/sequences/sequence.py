"""A sequence in memory: output of all readers and the simulator, input of training and evaluation.

Pictures remain 8-bit (one byte per channel); `Sequence.frame` converts one frame on demand. File formats and mask
polarities are resolved: a mask is True on tissue, and a depth of 0 means no depth.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from endotsr.config import SequenceConfig
from endotsr.method.splatting.camera import Camera
from endotsr.untrusted.names import file_name
from endotsr.untrusted.sections import Section

IN_MEMORY = "arrays in memory"  # source of a sequence that Python made


class Frame(NamedTuple):
    """One frame as the losses use it. Image and depth have the requested precision."""

    image: NDArray[np.floating]  # (3, H, W) display RGB in [0, 1]
    mask: NDArray[np.bool_]  # (H, W)    True = tissue
    depth: NDArray[np.floating]  # (H, W)    view-space z, scene units; 0 = no depth
    time: float  # normalised, in [0, 1)
    camera: Camera


@dataclass(frozen=True, eq=False)
class Sequence:
    """n frames of H x W pixels with masks, depth prior, cameras and a split.

    The notes are sentences on the assumptions and findings of the reader: polarity, fractions, thresholds, repairs.
    """

    images: NDArray[np.uint8]  # (n, 3, H, W) display RGB
    masks: NDArray[np.bool_]  # (n, H, W)    True = tissue
    depth: NDArray[np.float32]  # (n, H, W)    view-space z, scene units; 0 = no depth
    times: NDArray[np.float64]  # (n,)         normalised, in [0, 1)
    cameras: list[Camera]  # n entries; the same object for a static camera
    names: list[str]  # n names, for messages and written pictures
    unit: str  # the scene unit, in words
    static_camera: bool
    train_index: NDArray[np.intp]  # ascending
    test_index: NDArray[np.intp]  # ascending, disjoint from train_index
    notes: list[str] = field(default_factory=list)
    duration: float = 0.0  # seconds from time 0 to time 1, n / frame rate; 0 = unknown
    source: str = IN_MEMORY  # the folder that was read, or `simulated`
    settings: SequenceConfig | None = None  # with which it was read; None: a training brings its own
    simulator: Section | None = None  # settings of a simulated sequence
    not_read: tuple[str, ...] = ()  # notes on entries of the folder that nothing reads

    def __post_init__(self) -> None:
        n, _, height, width = self.images.shape
        expected: dict[str, tuple[Any, tuple[int, ...], type]] = {
            "images": (self.images, (n, 3, height, width), np.uint8),
            "masks": (self.masks, (n, height, width), np.bool_),
            "depth": (self.depth, (n, height, width), np.float32),
            "times": (self.times, (n,), np.float64),
        }
        for name, (array, shape, dtype) in expected.items():
            if array.shape != shape or array.dtype != dtype:
                raise ValueError(f"{name}: {shape} of {np.dtype(dtype)} expected, got {array.shape} of {array.dtype}")
        if len(self.cameras) != n or len(self.names) != n:
            raise ValueError(f"{n} frames, but {len(self.cameras)} cameras and {len(self.names)} names")
        for name in self.names:
            file_name(name, "names of the frames")
        if np.intersect1d(self.train_index, self.test_index).size:
            raise ValueError("a frame is both training and held out")

    @property
    def count(self) -> int:
        """Number of frames n."""
        return len(self.images)

    @property
    def frame_rate(self) -> float | None:
        """Mean frame rate, frames per second; None: unknown."""
        return self.count / self.duration if self.duration else None

    @property
    def height(self) -> int:
        """Rows of a frame."""
        return self.images.shape[2]

    @property
    def width(self) -> int:
        """Columns of a frame."""
        return self.images.shape[3]

    @property
    def tissue_fraction(self) -> float:
        """Fraction of tissue among all pixels of all frames."""
        return float(self.masks.mean())

    def tissue_depth(self, index: int) -> float | None:
        """Median depth of the tissue of a frame, scene units; None without depth."""
        depth = self.depth[index][self.masks[index]]
        known = depth[depth > 0]
        return float(np.median(known)) if known.size else None

    def picture(self, index: int) -> NDArray[np.uint8]:
        """The picture of frame `index` as readers have it, (H, W, 3) RGB."""
        return np.ascontiguousarray(self.images[index].transpose(1, 2, 0))

    def frame(self, index: int, dtype: DTypeLike = np.float32) -> Frame:
        """Frame `index` with image and depth in `dtype`; image = 8-bit value / 255.

        Raises:  IndexError outside 0 .. n-1.
        """
        if not 0 <= index < self.count:
            raise IndexError(f"frame {index} of a sequence of {self.count}")
        return Frame(
            image=np.divide(self.images[index], 255, dtype=dtype),
            mask=self.masks[index],
            depth=self.depth[index].astype(dtype),
            time=float(self.times[index]),
            camera=self.cameras[index],
        )
