"""Small MP4 and Matroska files, and a change of each field of their video track that is used.

A box or an element under another name is one that a reader does not find.
"""

import tempfile
from fractions import Fraction
from functools import cache
from pathlib import Path

import av
import numpy as np
import yaml
from field_formats import Format, Keys, result, stated, write_yaml
from field_formats import pictures as pictures_of
from input_kinds import hidden_lead_in
from made_videos import pictures, turn

from endotsr.clips.formats import video_marks
from endotsr.clips.formats.slam_calibrations import EUROC, ORB
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.source_options import SourceOptions

STATED = SourceOptions(camera=(100.0, 100.0, 64.0, 48.0), baseline=4.0, orientation="turned")
NUMBERS = {name: number.to_bytes((number.bit_length() + 7) // 8) for number, name in video_marks.ELEMENTS.items()}
KEPT = ("mdhd", "stts", "elst", "tkhd", "stsd", "stsc", "stsz", "stco", "mdia", "minf", "stbl", "trak", "edts",
        "avcC")  # fmt: skip
VOID = {1: b"\xec", 2: b"\x53\xc4"}  # an element without content, and one that is not known


@cache
def made(name: str) -> bytes:
    """An MP4 turned by half with a lead-in that an edit list hides, or a Matroska file of pairs with oblong pixels."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if name == "mp4":
            hidden_lead_in(folder)
            return turn(folder / "a.mp4", 180).read_bytes()
        # Without this flag the file holds random identifiers, in which a mark of one byte may turn up.
        with av.open(str(folder / "a.mkv"), "w", options={"fflags": "+bitexact"}) as container:
            stream = container.add_stream("ffv1", rate=25)
            stream.width, stream.height, stream.pix_fmt = 128, 96, "bgr0"
            stream.codec_context.sample_aspect_ratio = Fraction(4, 3)
            stream.metadata["stereo_mode"] = "left_right"
            for pixels in pictures(4):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
            container.mux(stream.encode())
        return (folder / "a.mkv").read_bytes()


def write_track(kind: str):
    """The video with fields renamed: None, to a name that means nothing; a pair of names, the first to the second."""

    def write_bytes(folder: Path, keys: Keys) -> None:
        data = made(kind)
        for name, value in keys.items():
            if value is not True:
                old, new = value or (name, None)
                mark = NUMBERS[old] if kind == "mkv" else old.encode()
                other = NUMBERS.get(new, VOID[len(mark)]) if kind == "mkv" else (new or "free").encode()
                place = data.index(mark, data.rindex(b"moov") if kind == "mp4" else 0)
                data = data[:place] + other + data[place + len(mark) :]
        (folder / f"a.{kind}").write_bytes(data)

    return write_bytes


def told(folder: Path) -> object:
    clip = describe(next(folder.iterdir()), STATED)
    return result(clip), clip.count, [note.replace(str(folder), "") for note in clip.notes]


ORB_BASE = {"Camera.type": "PinHole", "Camera.fx": 30.0, "Camera.fy": 31.0, "Camera.cx": 15.0, "Camera.cy": 11.0,
            "Camera.k1": 0.1, "Camera.k2": 0.01, "Camera.p1": 1e-3, "Camera.p2": 1e-3, "Camera.k3": 1e-3,
            "Camera.width": 32, "Camera.height": 24, "Camera.bf": 0.12}  # fmt: skip
ORB_CHANGES = {name: 2 * value for name, value in ORB_BASE.items() if name != "Camera.type"} | {
    "Camera.type": "KannalaBrandt8", "Stereo.b": 0.2}  # fmt: skip
MOUNT = {"cols": 4, "rows": 4, "data": np.eye(4).ravel().tolist()}
OTHER_MOUNT = {"cols": 4, "rows": 4, "data": [1.0, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}


def write_rig(folder: Path, keys: Keys) -> None:
    """The folder mav0/ of a camera with these keys, and poses of its body."""
    (folder / "cam0").mkdir()
    pictures_of(folder / "cam0", "data")
    rows = [f"{10**18 + k * 4 * 10**7},{k:03d}.png" for k in range(4)]
    (folder / "cam0/data.csv").write_text("#timestamp [ns],filename\n" + "\n".join(rows))
    (folder / "cam0/sensor.yaml").write_text(yaml.safe_dump({k: v for k, v in keys.items() if v is not None}))
    (folder / "state_groundtruth_estimate0").mkdir()
    poses = [f"{row.split(',')[0]},{k},0,0,1,0,0,0" for k, row in enumerate(rows)]
    head = "#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n"
    (folder / "state_groundtruth_estimate0/data.csv").write_text(head + "\n".join(poses))


EUROC_BASE = {"T_BS": MOUNT, "resolution": [32, 24], "camera_model": "pinhole", "intrinsics": [30, 31, 15, 11],
              "distortion_model": "radial-tangential", "distortion_coefficients": [0.1, 0, 0, 0]}  # fmt: skip
EUROC_CHANGES = {"T_BS": OTHER_MOUNT, "resolution": [64, 48], "camera_model": "omni", "intrinsics": [33, 31, 15, 11],
                 "distortion_model": "equidistant", "distortion_coefficients": [0.2, 0, 0, 0]}  # fmt: skip
TRACKS = {
    "mp4": Format(video_marks.MP4, dict.fromkeys(KEPT, True), write_track("mp4"), told, dict.fromkeys(KEPT),
                  {"encv": ("avc1", "encv")} | {name: ("btrt", name) for name in ("sv3d", "vexu", "lhvC", "sinf")}),
    "mkv": Format(video_marks.MATROSKA, dict.fromkeys(("PixelWidth", "StereoMode", "DisplayWidth"), True),
                  write_track("mkv"), told, dict.fromkeys(("PixelWidth", "PixelHeight", "StereoMode", "DisplayWidth")),
                  {"OldStereoMode": ("StereoMode", "OldStereoMode")}
                  | {f"PixelCrop{side}": ("DisplayHeight", f"PixelCrop{side}") for side in
                     ("Top", "Bottom", "Left", "Right")}),
    "orb": Format(ORB, ORB_BASE, write_yaml, stated, ORB_CHANGES, {"Camera.k4": 0.1, "Camera2.fx": 30.0,
                  "LEFT.K": [1], "Stereo.T_c1_c2": [1]}),
    "euroc": Format(EUROC, EUROC_BASE, write_rig, lambda folder: result(describe(folder)), EUROC_CHANGES, {}),
}  # fmt: skip
# In these files the coded pictures repeat it, or the file has none; inputs_tried.py tries colour, fields and pairs.
REPEATED = {
    "mp4": {*video_marks.CODECS, "ctts", "co64", "stss", "dinf", "dref", "vmhd", "hdlr", "hvcC", "av1C", "vpcC", "esds",
            "pasp", "colr", "fiel", "st3d"},
    "mkv": {"DisplayHeight", "DisplayUnit", "AspectRatioType", "FlagInterlaced", "FieldOrder", "Colour", "Projection",
            "ColourSpace"},
    "orb": {f"Camera1.{name}" for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")},
}  # fmt: skip
