"""Inputs as users have them, made up with real codecs, and what each command does with them.

    python tests/clips/sequences/inputs/inputs_tried.py            the table in Markdown
    python tests/clips/sequences/inputs/inputs_tried.py WORD       the rows whose kind holds the word

An outcome is `right` (the numbers that were written are those of the input), `told` (right, and a printed line names
what was done or assumed), `refused` (exit code 1 or 2 and one line), or `WRONG IN SILENCE`. `test_inputs_tried.py`
asserts every row.
"""

import contextlib
import io
import sys
import tempfile
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
sys.path.insert(0, str(Path(__file__).parents[3]))
import one_view
from brought_inputs import BROUGHT_ROWS
from builders import builder
from careless_inputs import CARELESS_ROWS
from depth_folders import WRONG as NO_LENGTHS
from depth_folders import true_depth
from exported_inputs import EXPORTED_ROWS
from input_kinds import (
    MATRIX,
    OPENCV,
    Outcome,
    Row,
    as_transparency,
    baseline,
    blank,
    both,
    calibrated,
    centred,
    close,
    codec,
    colmap,
    common,
    converted,
    cut,
    depth,
    depth_is_true,
    each,
    every_second_jpg,
    exif,
    files,
    folder_of,
    half_excluded,
    kalibr_text,
    mask,
    masked,
    named,
    prepare,
    public,
    rated,
    raw,
    ros_text,
    shortened,
    sides,
    size,
    timed,
    transparent,
    video,
)
from left_inputs import LEFT_ROWS
from made_videos import HEIGHT, INTERLACED, UNEVEN, WIDTH, picture, pictures, turn, woven, write
from mask_inputs import MASK_ROWS
from matlab_inputs import MATLAB_ROWS
from odd_inputs import ODD_ROWS
from raw_sources import stereomis
from rig_inputs import RIG_ROWS
from scoped_scenes import scene, through_a_scope
from silent_inputs import SILENT_ROWS
from squeezed_inputs import SQUEEZED_ROWS
from strange_inputs import STRANGE_ROWS
from stranger_inputs import STRANGER_ROWS
from stream_inputs import STREAM_ROWS
from surgeon_inputs import SURGEON_ROWS
from time_inputs import BESIDE_ROWS, TIME_ROWS

from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.sequence_file import read_sequence_file

WRONG = "WRONG IN SILENCE"
LONGEST = 200  # characters of a message in the table
NOT_HERE = {  # codecs that no package here encodes, so that no recording of them can be made
    "H.264 in separate field pictures (PAFF)": "the encoder x264 writes adaptive fields alone",
    "DV and DVCPRO": "their encoders take broadcast sizes alone",
    "DICOM and endoscope formats of a vendor": "no open encoder",
}
WIDE = [picture(i, 1280, 720) for i in range(3)]
DEINTERLACED = [picture(2 * i) for i in range(12)]
STEREO = [np.hstack([p, p]) for p in pictures()]


@builder
def deinterlaced(folder: Path, frames) -> bool:
    """The written pictures are these, and no row of another moment stands between two others."""
    red = [read_png(file)[..., 0].astype(int) for file in sorted((folder / "o/images").iterdir())]
    combs = [np.abs(shown[2:-1:2] - (shown[1:-2:2] + shown[3::2]) / 2).mean() for shown in red]
    return close(frames, 8.0)(folder) and max(combs) < 3.4  # 2.4 deinterlaced, 4.5 as stored


def turned_clockwise(degrees: int):
    """The written pictures are turned, and the camera has their size."""
    frames = [np.rot90(shown, -degrees // 90) for shown in pictures()]
    return both(close(frames), size(frames[0].shape[1], frames[0].shape[0]))


def scratched(path: Path) -> None:
    """Bytes in the middle of the pictures are overwritten."""
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = np.random.default_rng(0).integers(0, 256, 4000).astype(np.uint8).tobytes()
    path.write_bytes(data)


def united_masks(folder: Path) -> list[str]:
    """Two sets of masks, each of which excludes a part of what both do."""
    parts = [mask(), mask()]
    parts[0][:, 20:], parts[1][:, :20] = 0, 0
    for name, part in zip("ab", parts):
        files(folder, name, [part] * 12)
    words = folder_of(pictures())(folder)
    return [*words, "--masks", str(folder / "a"), "--unite-masks", str(folder / "b")]


def two_streams(folder: Path) -> list[str]:
    """Two views as two streams of one file."""
    with av.open(str(folder / "a.mkv"), "w") as container:
        streams = [container.add_stream("libx264", rate=25) for _ in range(2)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for shown in pictures():
            for k, stream in enumerate(streams):
                moved = np.roll(shown, -20 * k, axis=1)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(moved, format="rgb24")))
        for stream in streams:
            container.mux(stream.encode())
    return prepare("a.mkv")(folder)


@builder
def high_definition(folder: Path, tagged: bool) -> list[str]:
    """Pictures of 1280x720 with the matrix of BT.709, which the file states or not."""
    with av.open(str(folder / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=25, options={"qp": "4"})
        stream.width, stream.height, stream.pix_fmt = 1280, 720, "yuv420p"
        if tagged:
            stream.codec_context.colorspace = 1
        for i in range(3):
            frame = av.VideoFrame.from_ndarray(picture(i, 1280, 720), format="rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
            frame.pts = i
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return prepare("a.mp4")(folder)


@builder
def one_camera(folder: Path, values, *words, points=0) -> list[str]:
    """A clip from one camera with the files of a network, and true depth at some points beside it."""
    where, given = one_view.clip(folder, values)
    if points:
        one_view.sparse(where, points)
    return ["depth", str(where), "--given", str(given), "--kind", "relative", *words]


def frozen(clip: Path) -> None:
    first = read_png(clip / "images/000000.png")
    each("images", lambda x: first)(clip)


def scope(folder: Path) -> list[str]:
    """A round field of view with an instrument, as a video."""
    write(folder / "a.mp4", through_a_scope(scene("pulling")[0])[0], options={"crf": "20"})
    return ["masks", str(folder / "a.mp4"), "--out", str(folder / "o")]


@builder
def exported(folder: Path, name: str, *words: str) -> list[str]:
    sys.path.insert(0, str(Path(__file__).parents[3] / "results" / "export"))
    from made_up_model import moving_scene

    from endotsr.results.export.files import export

    export(moving_scene(), folder / "a.npz")
    return ["export", str(folder / "a.npz"), "--out", str(folder / name), *words]


@builder
def text_file(folder: Path, name: str, content: bytes) -> list[str]:
    (folder / name).write_bytes(content)
    return prepare(name)(folder)


def joined(folder: Path) -> list[str]:
    """A transport stream whose pictures change their size in the middle."""
    small = [picture(i, 96, 64) for i in range(6)]
    parts = [write(folder / f"{k}.ts", frames, "mpeg2video") for k, frames in enumerate((pictures(6), small))]
    (folder / "a.ts").write_bytes(b"".join(part.read_bytes() for part in parts))
    return prepare("a.ts")(folder)


ROWS = [
    codec("H.264, mp4", "a.mp4", "libx264"),
    codec("H.264, mkv", "a.mkv", "libx264"),
    codec("H.264, mov", "a.mov", "libx264"),
    codec("H.264, avi", "a.avi", "libx264", options={"bf": "0"}),
    codec("H.264, transport stream", "a.ts", "libx264"),
    codec("H.264, camera stream .mts", "a.m2ts", "libx264"),
    codec("H.264 4:2:2", "a.mp4", "libx264", "yuv422p"),
    codec("H.264 4:4:4", "a.mp4", "libx264", "yuv444p"),
    codec("H.264 10 bit", "a.mkv", "libx264", "yuv420p10le"),
    codec("H.264 full range", "a.mp4", "libx264", "yuvj420p"),
    codec("H.264 with B-frames", "a.mp4", "libx264", options={"bf": "3", "g": "12"}),
    codec("H.265, mp4", "a.mp4", "libx265"),
    codec("H.265 10 bit, mkv", "a.mkv", "libx265", "yuv420p10le"),
    codec("AV1, mkv", "a.mkv", "libsvtav1"),
    codec("AV1, mp4", "a.mp4", "libsvtav1"),
    codec("VP8, webm", "a.webm", "libvpx"),
    codec("VP9, webm", "a.webm", "libvpx-vp9"),
    codec("MPEG-1", "a.mpg", "mpeg1video", options={"b": "4000000"}),
    codec("MPEG-2, mpg", "a.mpg", "mpeg2video", options={"b": "4000000"}),
    codec("MPEG-2, transport stream", "a.ts", "mpeg2video", options={"b": "4000000"}),
    codec("MPEG-4 part 2, avi", "a.avi", "mpeg4", options={"b": "4000000"}),
    codec("WMV 8, wmv", "a.wmv", "wmv2", options={"b": "4000000"}),
    codec("Motion JPEG, avi", "a.avi", "mjpeg", "yuvj420p"),
    codec("Motion JPEG, mov", "a.mov", "mjpeg", "yuvj420p"),
    codec("ProRes, mov", "a.mov", "prores_ks", "yuv422p10le"),
    codec("FFV1, mkv", "a.mkv", "ffv1", "bgr0"),
    codec("PNG, mov", "a.mov", "png", "rgb24"),
    codec("HuffYUV, avi", "a.avi", "huffyuv", "rgb24"),
    codec("uncompressed, avi", "a.avi", "rawvideo", "bgr24"),
    *(
        Row(f"video, interlaced {kind}", video(name, woven(), codec=code, options=options), "told",
            "is interlaced: deinterlaced", deinterlaced(DEINTERLACED))
        for kind, (name, code, options) in INTERLACED.items()
    ),
    *(
        Row(f"video, uneven times, {name[2:]}", video(name, None, codec=code, milliseconds=UNEVEN), "told",
            "not evenly spaced (0.033 to 0.633 s apart)", both(timed(UNEVEN), rated(11 / 1.333)))
        for name, code in (("a.mkv", "libx264"), ("a.mp4", "libx264"), ("a.webm", "libvpx-vp9"))
    ),
    Row("video, uneven times, thinned by --rate", video("a.mkv", None, "--rate", "2", milliseconds=UNEVEN), "told",
        "by their times", close([picture(i) for i in (0, 4, 7)])),
    Row("video, uneven times, --source-rate", video("a.mkv", None, "--source-rate", "10", milliseconds=UNEVEN), "told",
        "10 a second", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, 60 a second thinned to 20", video("a.mp4", None, "--rate", "20", rate=60), "told", "4 of 12 frames",
        both(close([picture(i) for i in (0, 3, 6, 9)]), rated(20))),
    Row("video, --rate above its own", video("a.mp4", None, "--rate", "50"), "refused", "the source has 25 frames"),
    *(
        Row(f"video, rotation of {degrees} degrees", video("a.mp4", change=lambda p, d=degrees: turn(p, d)), "refused",
            "--orientation turned")
        for degrees in (90, 180, 270)
    ),
    *(
        Row(f"video, rotation of {degrees} degrees, --orientation {way}", video("a.mp4", None, "--orientation", way,
            change=lambda p, d=degrees: turn(p, d)), "told", "states a rotation",
            turned_clockwise(degrees if way == "turned" else 0))
        for degrees in (90, 180, 270) for way in ("turned", "stored")
    ),
    Row("video, pixels that are not square", video("a.mkv", shape=Fraction(16, 15)), "told", "times as wide as high"),
    Row("video, high dynamic range (PQ)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=16),
        "refused", "high dynamic range (PQ)"),
    Row("video, high dynamic range (HLG)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=18),
        "refused", "high dynamic range (HLG)"),
    Row("video, black", video("a.mp4", [picture(0) * 0] * 8), "refused",
        "8 of 8 frames are black, white or of one colour: 000000, 000001"),
    Row("video, one colour", video("a.mp4", [picture(0) * 0 + np.uint8(90)] * 8), "refused", "of one colour"),
    Row("video, frozen", video("a.mp4", [picture(0)] * 8), "refused", "all 8 frames are one picture"),
    Row("video, a black second in it", video("a.mp4", [*pictures(9), *[picture(0) * 0] * 3]), "told", "black-frame"),
    Row("video, odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1", layout="bgr0"),
        "right", "", size(127, 95)),
    Row("video, cut inside", video("a.mp4", [*pictures(6), *[picture(i)[::-1, ::-1].copy() for i in range(6)]]), "told",
        "000006 does not resemble 000005"),
    Row("video, a frame repeated", video("a.mp4", [picture(i - (i > 2)) for i in range(12)]), "told", "repeats 000002"),
    Row("video, every third frame repeated", video("a.mp4", [picture(i - i // 3) for i in range(12)]), "told",
        "1 of every 3 frames repeat"),
    Row("video, stereo that is not named", video("a.mp4", STEREO), "told", "side by side, resemble each"),
    Row("video, stereo, stacked, that is not named", video("a.mp4", [np.vstack([p, p]) for p in pictures()]), "told",
        "stacked, resemble each other"),
    Row("video, two streams", two_streams, "told", "2 video streams: one is read", close(pictures())),
    Row("video, with transparency", video("a.mov", None, codec="png", layout="rgba"), "told", "transparency is ignored",
        close(pictures())),
    Row("video, high definition, BT.709", high_definition(tagged=True), "right", "", close(WIDE, 3)),
    Row("video, high definition, no matrix of colour", high_definition(tagged=False), "told",
        "BT.601 is assumed, but players assume BT.709", close(WIDE)),
    Row("video, one picture", video("a.mp4", pictures(1)), "right", "",
        lambda folder: read_sequence_file(folder / "o").frames == 1),
    Row("video, truncated mp4, index at the end", video("a.mp4", change=cut(0.7)), "refused", "holds no pictures"),
    Row("video, truncated mp4, index in front", video("a.mp4", pictures(40), options={"bf": "0"},
        container={"movflags": "faststart"}, change=cut(0.7)), "refused", "truncated or damaged"),
    Row("video, damaged H.264", video("a.mp4", pictures(40), options={"qp": "4"}, change=scratched), "refused",
        "picture"),
    Row("video, size changes", joined, "refused", "use one size"),
    Row("video, stereo, side by side", video("a.mp4", STEREO, "--stereo", "side_by_side", "--baseline", "4"), "right",
        "", both(sides(pictures(), pictures()), baseline(4))),
    Row("video, stereo, of odd width", video("a.mkv", [p[:, :127] for p in pictures()], "--stereo", "side_by_side",
        "--baseline", "4", codec="ffv1", layout="bgr0"), "refused", "even width"),
    Row("text named .mp4", text_file("a.mp4", b"hello " * 99), "refused", "not a video by its first bytes"),
    Row("play list named .mp4", text_file("a.mp4", b"#EXTM3U\nfile:///etc/passwd\n"), "refused", "not a video by its"),
    Row("empty file named .mp4", text_file("a.mp4", b""), "refused", "not a video by its first bytes"),
    Row("pictures, png", folder_of(pictures()), "right", "", close(pictures(), 0.01)),
    Row("pictures, jpg", folder_of(pictures(), ending="jpg"), "right", "", close(pictures())),
    Row("pictures, jpg turned by EXIF", folder_of(pictures(), change=converted("jpg", exif=exif(6))), "refused",
        "orientation 6"),
    Row("pictures, interlaced", folder_of(woven()), "told", "interlaced-pictures"),
    Row("pictures, 16 bit", folder_of([p.astype(np.uint16) * 257 for p in pictures()]), "refused", "16-bit picture"),
    Row("pictures, grey", folder_of([p[..., 0] for p in pictures()]), "refused", "grey picture"),
    Row("pictures, transparent", folder_of(pictures(), change=transparent(40)), "refused", "has transparent pixels"),
    Row("pictures, with a full alpha channel", folder_of(pictures(), change=transparent(0)), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, with a palette", folder_of(pictures(), change=converted("png", lambda opened: opened.quantize(256))),
        "right", "", close(pictures())),
    Row("pictures, png and jpg mixed", folder_of(pictures(), change=every_second_jpg), "right", "", close(pictures())),
    Row("pictures, CMYK jpg", folder_of(pictures(), change=converted("jpg", lambda opened: opened.convert("CMYK"),
        quality=95)), "right", "", close(pictures())),
    Row("pictures, numbered without zeros", named(lambda k: f"{k}.png"), "right", "", close(pictures(), 0.01)),
    Row("pictures, tif", folder_of(pictures(), change=converted("tif")), "right", "", close(pictures(), 0.01)),
    Row("pictures, tif, LZW", folder_of(pictures(), change=converted("tif", compression="tiff_lzw")), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, tif, two in a file", folder_of(pictures(), change=converted("tif", save_all=True,
        append_images=[blank()])), "refused", "holds 2 pictures"),
    Row("pictures, webp", folder_of(pictures(), change=converted("webp", quality=90)), "right", "", close(pictures())),
    Row("pictures, webp without loss", folder_of(pictures(), change=converted("webp", lossless=True)), "right", "",
        close(pictures(), 0.01)),
    Row("pictures, webp, moving", folder_of(pictures(), change=converted("webp", save_all=True,
        append_images=[blank()])), "refused", "holds 2 pictures"),
    Row("pictures, bmp", folder_of(pictures(), change=converted("bmp")), "right", "", close(pictures(), 0.01)),
    *(Row(f"pictures, {kind} cut off", folder_of(pictures(), change=shortened(kind)), "refused", "damaged")
      for kind in ("tif", "webp", "bmp")),
    Row("pictures, colour profile of another space", folder_of(pictures(), change=converted("png",
        icc_profile=b"Display P3" * 20)), "told", "a colour profile other than sRGB", close(pictures(), 0.01)),
    Row("pictures of two sizes", folder_of([*pictures(3), picture(3)[:80]]), "refused", "128x80 pixels, others 128x96"),
    Row("pictures, black", folder_of([picture(0) * 0] * 5), "refused", "5 of 5 frames are black"),
    Row("pictures, one under many names", folder_of([picture(0)] * 5), "refused", "all 5 frames are one picture"),
    Row("masks, right", masked([mask()] * 12), "right", "", half_excluded),
    Row("masks, one missing", masked([mask()] * 12, count=11), "refused", "1 of 12 frames have no mask"),
    Row("masks, missing, --gaps drop", masked([mask()] * 12, "--gaps", "drop", count=11), "told", "left out"),
    Row("masks, of half the size", masked([mask()[::2, ::2]] * 12), "right", "", half_excluded),
    Row("masks, stored as transparency", masked([mask()] * 12, change=as_transparency), "refused",
        "a mask that is stored as transparency"),
    Row("masks, of other proportions", masked([mask()[:50]] * 12), "refused", "another aspect ratio"),
    Row("masks, soft", masked([(mask() // 2 + np.arange(WIDTH)).astype(np.uint8)] * 12), "refused",
        "this is not a mask"),
    Row("depth, millimetres", depth(true_depth), "right", "", depth_is_true),
    Row("depth, metres, stated", depth(lambda i: true_depth(i) / 1e3, "--depth-unit", "m"), "right", "", depth_is_true),
    *(Row(f"depth, {kind}", depth(values, name=name, kind=ending), "refused", said)
      for kind, (values, name, ending, said) in NO_LENGTHS.items()),
    Row("depth, of half the size", depth(lambda i: true_depth(i)[::2, ::2]), "refused", "depth of 64x48 pixels"),
    Row("depth, not a number", depth(lambda i: true_depth(i) * np.nan), "refused", "no value is finite"),
    Row("one camera, relative depth, points to compare with",
        one_camera(lambda i: 1800 / true_depth(i) - 3, "--replace", points=60), "told",
        "scale and shift from the depth before", depth_is_true),
    Row("one camera, relative depth alone", one_camera(lambda i: 1800 / true_depth(i) - 3), "told",
        "not metric (scale and shift of the depth assumed)"),
    Row("one camera, relative depth that grows with distance", one_camera(lambda i: true_depth(i) / 99), "refused",
        "near tissue is bright"),
    Row("one camera, no depth at all", video("a.mp4"), "told", "--kind relative"),
    Row("depth beside COLMAP", colmap("--depth", "d"), "refused", "does not read --depth"),
    Row("Hamlyn", public("hamlyn", "--baseline", "5"), "told", "half a pixel was added", centred),
    Row("SERV-CT", public("servct"), "told", "not for training one scene", centred),
    Row("SCARED", public("scared"), "told", "read as world-to-camera",
        lambda folder: len(read_sequence_file(folder / "o").poses.matrices) == 4),
    Row("C3VD", public("c3vd", "--scale", "0.1"), "told", "undistorted to a pinhole camera", size(135, 108)),
    Row("nerfstudio", public("nerfstudio"), "told", "unit of lengths unknown", centred),
    Row("nerfstudio, fisheye", public("nerfstudio", camera_model="OPENCV_FISHEYE"), "refused", "camera_model"),
    Row("nerfstudio, a picture missing", public("nerfstudio",
        change=lambda raw: (raw / "images/frame_00002.png").unlink()), "refused", "frame_00002.png"),
    Row("nerfstudio, out and for COLMAP", public("nerfstudio", "--also", "nerfstudio", "colmap"), "told",
        "points of the prior depth", centred),
    Row("calibration, ROS", calibrated("a.yaml", ros_text()), "told", "half a pixel was added", centred),
    Row("calibration, ROS, fisheye", calibrated("a.yaml", ros_text(distortion_model="equidistant")), "refused",
        "use plumb_bob or rational_polynomial"),
    Row("calibration, Kalibr", calibrated("a.yaml", kalibr_text()), "told", "half a pixel was added", centred),
    Row("calibration, Kalibr, of another size", calibrated("a.yaml", kalibr_text(resolution=[128, 128])),
        "refused", "the calibration is of 128x128"),
    Row("calibration, matrix K as text", calibrated("K.txt", MATRIX), "told", "half a pixel was added",
        centred),
    Row("calibration, OpenCV YAML", calibrated("a.yaml", OPENCV), "told", "half a pixel was added", centred),
    Row("calibration, a hostile tag in YAML", calibrated("a.yaml", "K: !!python/object/apply:os.getcwd []"),
        "refused", "not YAML"),
    Row("frames by second and frames left out", video("a.mp4", None, "--frames", "0s:0.24s", "--drop", "1"), "told",
        "not evenly spaced", close([picture(i) for i in (0, 2, 3, 4, 5)])),
    Row("frames beyond the end", video("a.mp4", None, "--frames", "0s:9s"), "refused", "ends after 0.440 seconds"),
    Row("crop", video("a.mp4", None, "--crop", "8", "4", "64", "48"), "told", "the intrinsics follow", size(64, 48)),
    Row("crop outside", video("a.mp4", None, "--crop", "100", "4", "64", "48"), "refused", "leaves the pictures"),
    Row("masks united", united_masks, "told", "masks: united with", half_excluded),
    Row("StereoMIS, a mask missing, --gaps drop", raw(stereomis, "--gaps", "drop",
        change=lambda raw: (raw / "masks/000002l.png").unlink()), "told", "not evenly spaced",
        timed((0, 40, 120, 160, 200))),
    Row("common format, masks inverted", common(change=each("masks", lambda x: 255 - x)), "refused",
        "set --sequence.excluded-value black"),
    Row("common format, masks inverted, the remedy", common("--sequence.excluded-value", "black",
        change=each("masks", lambda x: 255 - x)), "right", "ready for training"),
    Row("common format, black pictures", common(change=each("images", lambda x: x * 0)), "refused", "no-picture"),
    Row("common format, one picture for ever", common(change=frozen), "refused", "constant-clip"),
    Row("common format, a mask over everything", common(change=lambda clip: write_png(clip / "masks/000002.png",
        np.full((24, 32), 255, np.uint8))), "told", "frame-without-tissue"),
    Row("common format, times that go back", common(times=[0.0, 0.1, 0.3, 0.2, 0.4]), "refused", "ascending seconds"),
    Row("common format, uneven times", common(times=[0.0, 0.1, 0.2, 0.9, 1.0]), "told", "uneven-times"),
    Row("masks of a round field of view", scope, "told", "field of view: ",
        lambda folder: all(0.3 < (read_png(file) > 0).mean() < 0.8 for file in (folder / "o/masks").iterdir())),
    *(Row(f"export to {name}", exported(name, *words), "refused", "use FILE.ply")
      for name, *words in (("a.spz",), ("a.splat",), ("a.obj", "--content", "mesh"), ("a.gltf", "--content", "mesh"))),
    *ODD_ROWS,
    *CARELESS_ROWS,
    *LEFT_ROWS,
    *SILENT_ROWS,
    *RIG_ROWS,
    *TIME_ROWS,
    *BESIDE_ROWS,
    *MATLAB_ROWS,
    *SQUEEZED_ROWS,
    *STREAM_ROWS,
    *MASK_ROWS,
    *STRANGER_ROWS,
    *STRANGE_ROWS,
    *EXPORTED_ROWS,
    *SURGEON_ROWS,
    *BROUGHT_ROWS,
]  # fmt: skip


def tried(row: Row, folder: Path) -> Outcome:
    """Make the input in an empty folder, run the command, and compare with what was expected."""
    words = row.make(folder)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(words)
    printed = out.getvalue() + err.getvalue()
    lines = [line.strip() for line in printed.replace(str(folder) + "/", "").splitlines() if line.strip()]
    named = next((line for line in lines if row.said and row.said in line), "")
    silent = row.expected == "refused" or (row.expected == "told" and not named)
    outcome = "refused" if code else WRONG if silent or not row.check(folder) else row.expected
    command = " ".join(["endotsr", *(word.replace(str(folder) + "/", "") for word in words)])
    return Outcome(row, command, outcome, named or (lines[-1] if lines else ""))


def table(word: str = "") -> str:
    """The rows whose kind holds the word, as Markdown."""
    lines, counts = ["| Input | Command | Outcome | Message |", "|---|---|---|---|"], {}
    for row in ROWS:
        if word in row.kind:
            with tempfile.TemporaryDirectory() as scratch:
                found = tried(row, Path(scratch))
            counts[found.outcome] = counts.get(found.outcome, 0) + 1
            message = found.message.replace("|", "/")[:LONGEST] if found.outcome != "right" else ""
            lines.append(f"| {row.kind} | `{found.command}` | {found.outcome} | {message} |")
    lines += [f"| {kind} | - | not tried | {why} |" for kind, why in NOT_HERE.items() if word in kind]
    total = ", ".join(f"{outcome}: {count}" for outcome, count in sorted(counts.items()))
    return "\n".join(
        [*lines, "", f"{sum(counts.values())} inputs; {total}; wrong in silence: {counts.get('WRONG IN SILENCE', 0)}"]
    )


if __name__ == "__main__":
    print(table(*sys.argv[1:2]))
