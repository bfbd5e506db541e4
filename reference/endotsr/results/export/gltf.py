"""Animated points as one binary glTF file (.glb), which Blender and other 3-D programs import.

In: a scene and times. Out: a point cloud at the first time, a morph target (displacements) for every other time, and an
animation of their weights. Positions between two times are interpolated linearly. The node transforms the axes of the
exports (y down, z forward) to those of glTF (y up, z backward), and millimetres to metres; another unit keeps its
numbers. Colours are those of degree 0 at the first time, converted from display RGB to linear RGB by the sRGB curve.
"""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from endotsr.clips.sequences.record import UNKNOWN_RATE
from endotsr.errors import InputError
from endotsr.method.kernels.arrays import Array, FloatArray
from endotsr.results.export.placement import placed_scene
from endotsr.results.export.ply import point_vertices
from endotsr.results.export.scene import MovingScene
from endotsr.untrusted.marks import GENERATOR
from endotsr.untrusted.writing import replace_file

LARGEST = 1 << 32  # bytes: the length of a .glb has 32 bits
FLOAT, SHORT = 5126, 5123  # component types of glTF
HALF_TURN = [1.0, 0.0, 0.0, 0.0]  # 180 degrees about x: quaternion x y z w


class _Buffer:
    """The binary data of a file, with its buffer views and accessors."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.views: list[dict[str, object]] = []
        self.accessors: list[dict[str, object]] = []

    def add(self, array: Array, kind: str, **more: Any) -> int:
        """Append (n, k) or (n,) numbers; returns the index of their accessor."""
        start, data = sum(map(len, self.parts)), np.ascontiguousarray(array).tobytes()
        self.parts.append(data + b"\0" * (-len(data) % 4))
        self.views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
        number = SHORT if array.dtype == np.uint16 else FLOAT
        entry = {"bufferView": len(self.views) - 1, "componentType": number, "count": len(array), "type": kind}
        self.accessors.append(entry | more)
        return len(self.accessors) - 1

    def positions(self, points: FloatArray) -> int:
        """Append (n, 3) positions or displacements with their bounds."""
        return self.add(points, "VEC3", min=points.min(axis=0).tolist(), max=points.max(axis=0).tolist())


def write_animated_points(
    file: Path, scene: MovingScene, times: list[float], least_opacity: float, taken_out: tuple[str, ...] = ()
) -> int:
    """Write the points of a scene at ascending times; returns their number.

    least_opacity   minimum opacity of the Gaussians whose centres are exported

    Raises: InputError for times that do not ascend in float32, for a scene without such a Gaussian, and above 4 GB.
    """
    record = scene.record
    seconds = np.multiply(times, record.duration or record.count / UNKNOWN_RATE)
    seconds = (seconds - seconds[0]).astype("<f4")
    if (np.diff(seconds) <= 0).any():
        raise InputError(f"{file}: the times of an animation must ascend; use each later than the previous one")
    shown = [point_vertices(placed_scene(scene.at(t, taken_out), scene.placement), least_opacity) for t in times]
    if not shown[0].size:
        raise InputError(f"{file}: no Gaussian has opacity {least_opacity:g} or more; use a smaller --opacity")
    if 12 * shown[0].size * (len(times) + 1) + 4 * len(times) ** 2 >= LARGEST:  # points and weights
        raise InputError(f"{file}: {shown[0].size} points at {len(times)} times need more than 4 GB; use --count")
    points = [np.stack([each[axis] for axis in "xyz"], axis=1) for each in shown]
    levels = np.stack([shown[0][name] for name in ("red", "green", "blue")], axis=1)
    content = _glb(points, levels, seconds, times, record.unit)
    replace_file(file, lambda temporary: temporary.write_bytes(content))
    return len(levels)


def _glb(points: list[FloatArray], levels: Array, seconds: FloatArray, times: list[float], unit: str) -> bytes:
    """The bytes of the file: header, JSON chunk, binary chunk."""
    buffer, scale = _Buffer(), 0.001 if unit == "mm" else 1.0
    colours = np.append(_linear(levels), np.full((len(levels), 1), 65535, np.uint16), axis=1)
    primitive: dict[str, object] = {
        "mode": 0,
        "material": 0,
        "attributes": {
            "POSITION": buffer.positions(points[0]),
            "COLOR_0": buffer.add(colours, "VEC4", normalized=True),
        },
    }
    mesh: dict[str, object] = {"name": "points", "primitives": [primitive]}
    about: dict[str, object] = {"asset": {"version": "2.0", **GENERATOR, "extras": {"unit": unit}}}
    if len(points) > 1:
        primitive["targets"] = [{"POSITION": buffer.positions(moved - points[0])} for moved in points[1:]]
        mesh |= {"weights": [0.0] * (len(points) - 1), "extras": {"targetNames": [f"t = {t:.6g}" for t in times[1:]]}}
        inputs = buffer.add(seconds, "SCALAR", min=[float(seconds[0])], max=[float(seconds[-1])])
        weights = buffer.add(np.eye(len(points), dtype="<f4")[:, 1:].ravel(), "SCALAR")
        sampler = {"input": inputs, "output": weights, "interpolation": "LINEAR"}
        channel = {"sampler": 0, "target": {"node": 0, "path": "weights"}}
        about["animations"] = [{"name": "motion", "samplers": [sampler], "channels": [channel]}]
    data = b"".join(buffer.parts)
    about |= {
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "scene", "mesh": 0, "rotation": HALF_TURN, "scale": [scale] * 3}],
        "meshes": [mesh],
        "materials": [{"name": "display colour", "extensions": {"KHR_materials_unlit": {}}}],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(about).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(data))
    return head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data


def _linear(levels: Array) -> Array:
    """8-bit display levels to 16-bit linear levels: the sRGB curve, IEC 61966-2-1."""
    shown = levels / 255
    return np.rint(65535 * np.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)).astype("<u2")
