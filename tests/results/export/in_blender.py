"""An animated .glb of this package in Blender: python tests/results/export/in_blender.py PYTHON

PYTHON is an interpreter with Blender as a module: `pip install bpy` asks for NumPy 1 and one version of Python, so that
it is not that of this package. The file is imported there, and its points at three times are compared with those of the
scene. The exit code is 1 if any is off by more than a micrometre.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from test_gltf import timed

from endotsr.results.export.files import Content, export
from endotsr.results.export.placement import placed_points
from endotsr.results.export.times import Times

TIMES, LEAST = (0.25, 0.4, 0.9), 0.6
DURATION = 2.0  # seconds of the scene
MICROMETRE = 1e-6  # m, the unit of glTF and of Blender
IMPORTED = """
import json, sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=sys.argv[1])
scene = bpy.context.scene
(points,) = [item for item in bpy.data.objects if item.type == "MESH"]
found = []
for seconds in json.loads(sys.argv[2]):
    frame = seconds * scene.render.fps
    scene.frame_set(int(frame), subframe=frame - int(frame))
    shown = points.evaluated_get(bpy.context.evaluated_depsgraph_get())
    found.append([list(shown.matrix_world @ vertex.co) for vertex in shown.data.vertices])
about = {"version": bpy.app.version_string, "colours": [a.domain for a in points.data.color_attributes]}
json.dump({"points": found} | about, open(sys.argv[3], "w"))
"""


def expected() -> np.ndarray:
    """Points in metres with z up, as Blender has them: x to the right, z forward becomes y, y down becomes -z."""
    scene, found = timed(DURATION), []
    for time in TIMES:
        moment = scene.at(time)
        chosen = 1 / (1 + np.exp(-moment.opacity_logit)) >= LEAST
        x, y, z = placed_points(moment.position, scene.placement)[:, chosen] * 1e-3
        found.append(np.stack([x, z, -y], axis=1))
    return np.array(found)


def main(interpreter: str) -> int:
    """The command."""
    with tempfile.TemporaryDirectory() as folder:
        file, result = Path(folder) / "scene.glb", Path(folder) / "found.json"
        export(timed(DURATION), file, Times(TIMES), Content(least_opacity=LEAST))
        seconds = json.dumps([DURATION * (time - TIMES[0]) for time in TIMES])
        subprocess.run([interpreter, "-c", IMPORTED, file, seconds, result], check=True, stdout=subprocess.DEVNULL)
        found = json.loads(result.read_text())
    points = expected()
    apart = float(np.abs(np.array(found["points"]) - points).max())
    moved = float(np.abs(points - points[0]).max())
    print(
        f"Blender {found['version']}: {points.shape[1]} points at {len(TIMES)} times, at most {apart * 1e9:.2g} nm from"
        f" the scene, in which they move by up to {moved * 1e3:.2g} mm; colours of each {', '.join(found['colours'])}"
    )
    return int(apart > MICROMETRE)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
