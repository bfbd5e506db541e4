"""Rows of `inputs_tried.py` about videos: containers, codecs, rates, interlacing, marks, damage."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import (
    GROUPS,
    TWICE,
    Row,
    both,
    close,
    cut,
    exchanged_frames,
    hidden_lead_in,
    prepare,
    size,
    slow,
    timed,
    video,
)
from made_videos import HEIGHT, INTERLACED, UNEVEN, WIDTH, picture, pictures, turn, woven, write
from PIL import Image
from stream_formats import write_avi, write_program, write_transport

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


def rated(rate: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, rate, rtol=1e-2)


def codec(kind: str, name: str, code: str, layout="yuv420p", **how) -> Row:
    return Row(f"video, {kind}", video(name, None, codec=code, layout=layout, **how), "right", "", close(pictures()))


WIDE = [picture(i, 1280, 720) for i in range(3)]
DEINTERLACED = [picture(2 * i) for i in range(12)]


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


def joined(folder: Path) -> list[str]:
    """A transport stream whose pictures change their size in the middle."""
    small = [picture(i, 96, 64) for i in range(6)]
    parts = [write(folder / f"{k}.ts", frames, "mpeg2video") for k, frames in enumerate((pictures(6), small))]
    (folder / "a.ts").write_bytes(b"".join(part.read_bytes() for part in parts))
    return prepare("a.ts")(folder)


def gif(folder: Path) -> list[str]:
    made = [Image.fromarray(shown) for shown in pictures()]
    made[0].save(folder / "a.gif", save_all=True, append_images=made[1:], duration=40)
    return prepare("a.gif")(folder)


PULLED_DOWN = [picture(i - i // 5) for i in range(40)]
WITH_A_PAUSE = [40 * i + 1500 * (i > 20) for i in range(60)]
PAUSE = [*range(0, 240, 40), *range(5000, 5240, 40)]  # milliseconds


@builder
def renamed_video(folder: Path, name: str, **how) -> list[str]:
    """A video under a name that does not end like one."""
    write(folder / f"a.{how.pop('kind')}", pictures(), **how)
    next(folder.glob("a.*")).rename(folder / name)
    return prepare(name)(folder)


def mirrored(path: Path) -> None:
    """The matrix of the track of an MP4 mirrors the pictures."""
    data = bytearray(path.read_bytes())
    place = data.index(b"tkhd") + 44
    data[place : place + 4] = struct.pack(">i", -65536)
    path.write_bytes(data)


def cropped(path: Path) -> None:
    """PixelCropRight in the place of DisplayUnit in a Matroska file."""
    path.write_bytes(path.read_bytes().replace(b"\x54\xb2\x81\x04", b"\x54\xdd\x81\x10", 1))


@builder
def stream(folder: Path, write, name: str, **keys) -> list[str]:
    (folder / "v").mkdir()
    write(folder / "v", keys)
    return prepare(f"v/{name}")(folder)


FOUR = close(pictures(4))


def pulled_down(folder: Path) -> list[str]:
    """Film of 24 pictures a second as video of 30: two of five pictures join two moments, and no mark says so."""
    film = [picture(2 * i) for i in range(32)]
    even = (np.arange(HEIGHT) % 2 == 0)[:, None, None]
    frames = []
    for a, b, c, d in zip(*(film[k::4] for k in range(4))):
        frames += [a, b, np.where(even, b, c), np.where(even, c, d), d]
    write(folder / "a.mp4", frames, rate=30, options={"qp": "4"})
    return prepare("a.mp4")(folder)


VIDEO_ROWS = [
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
    Row("video, odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1", layout="bgr0"),
        "right", "", size(127, 95)),
    Row("video, 4:2:0 of odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1"), "right", "",
        size(127, 95)),
    Row("video, 12 bit", video("a.mkv", codec="libx265", layout="yuv420p12le"), "right", "", close(pictures())),
    Row("video, RGB of 16 bit", video("a.mkv", codec="ffv1", layout="gbrp16le"), "right", "", close(pictures(), 1)),
    Row("GIF", gif, "refused", "no known layout"),
    Row("video of a recorder, .VOB", renamed_video("A.VOB", kind="mpg", codec="mpeg2video", options={"b": "4000000"}),
        "right", "", close(pictures())),
    Row("video without an ending", renamed_video("recording", kind="mkv"), "right", "", close(pictures())),
    Row("video, .flv", renamed_video("a.flv", kind="flv"), "right", "", close(pictures())),
    Row("video, H.265 4:2:2 10 bit", video("a.mp4", codec="libx265", layout="yuv422p10le"), "right", "",
        close(pictures())),
    *(Row(f"video, interlaced {kind}", video(name, woven(), codec=code, options=options), "told",
        "is interlaced: deinterlaced", deinterlaced(DEINTERLACED)) for kind, (name, code,
        options) in INTERLACED.items()),
    *(Row(f"video, uneven times, {name[2:]}", video(name, None, codec=code, milliseconds=UNEVEN), "told",
        "not evenly spaced (0.033 to 0.633 s apart)", both(timed(UNEVEN), rated(11 / 1.333))) for name,
        code in (("a.mkv", "libx264"), ("a.mp4", "libx264"), ("a.webm", "libvpx-vp9"))),
    Row("video, uneven times, thinned by --rate", video("a.mkv", None, "--rate", "2", milliseconds=UNEVEN), "told",
        "by their times", close([picture(i) for i in (0, 4, 7)])),
    Row("video, uneven times, --source-rate", video("a.mkv", None, "--source-rate", "10", milliseconds=UNEVEN), "told",
        "10 a second", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, 60 a second thinned to 20", video("a.mp4", None, "--rate", "20", rate=60), "told", "4 of 12 frames",
        both(close([picture(i) for i in (0, 3, 6, 9)]), rated(20))),
    Row("video, --rate above its own", video("a.mp4", None, "--rate", "50"), "refused", "the source has 25 frames"),
    *(Row(f"video, rotation of {degrees} degrees", video("a.mp4", change=lambda p, d=degrees: turn(p, d)), "refused",
        "--orientation turned") for degrees in (90, 180, 270)),
    *(Row(f"video, rotation of {degrees} degrees, --orientation {way}", video("a.mp4", None, "--orientation", way,
        change=lambda p, d=degrees: turn(p, d)), "told", "states a rotation",
        turned_clockwise(degrees if way == "turned" else 0)) for degrees in (90, 180, 270) for way in ("turned",
        "stored")),
    Row("video, pixels that are not square", video("a.mkv", shape=Fraction(16, 15)), "told", "times as wide as high"),
    Row("video, high dynamic range (PQ)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=16), "refused",
        "high dynamic range (PQ)"),
    Row("video, high dynamic range (HLG)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=18),
        "refused", "high dynamic range (HLG)"),
    Row("video, black", video("a.mp4", [picture(0) * 0] * 8), "refused",
        "8 of 8 frames are black, white or of one colour: 000000, 000001"),
    Row("video, one colour", video("a.mp4", [picture(0) * 0 + np.uint8(90)] * 8), "refused", "of one colour"),
    Row("video, frozen", video("a.mp4", [picture(0)] * 8), "refused", "all 8 frames are one picture"),
    Row("video, a black second in it", video("a.mp4", [*pictures(9), *[picture(0) * 0] * 3]), "told", "black-frame"),
    Row("video, cut inside", video("a.mp4", [*pictures(6), *[picture(i)[::-1, ::-1].copy() for i in range(6)]]), "told",
        "000006 does not resemble 000005"),
    Row("video, a frame repeated", video("a.mp4", [picture(i - (i > 2)) for i in range(12)]), "told", "repeats 000002"),
    Row("video, every third frame repeated", video("a.mp4", [picture(i - i // 3) for i in range(12)]), "told",
        "1 of every 3 frames repeat"),
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
    Row("video, linear light", video("a.mp4", layout="yuv444p", transfer=8), "refused", "linear light"),
    Row("video, colours of BT.2020", video("a.mkv", codec="libx265", layout="yuv420p10le", primaries=9), "told",
        "states BT.2020 colours"),
    Row("video, every picture twice, coded", video("a.mp4", TWICE, options={"crf": "28"}), "told",
        "every second frame repeats the one before (20 of 40 frames"),
    Row("video, every picture twice, --frames ::2", video("a.mp4", TWICE, "--frames", "::2"), "right", "",
        close(TWICE[::2])),
    Row("video, 24 a second stored as 30", video("a.mp4", PULLED_DOWN, options={"crf": "28"}), "told",
        "1 of every 5 frames repeat"),
    Row("video, lead-in hidden by an edit list", hidden_lead_in, "right", "", close(pictures(24)[5:])),
    Row("video, begins inside a group of pictures", video("a.ts", pictures(40), options=GROUPS,
        change=lambda path: path.write_bytes(path.read_bytes()[188 * 10 :])), "told",
        "coded pictures cannot be decoded and are left out", close(pictures(40)[12:])),
    Row("video, two files joined, the clock goes back", video("a.ts", pictures(40),
        change=lambda path: path.write_bytes(path.read_bytes() * 2)), "told", "its clock goes back",
        both(close(pictures(40) * 2), rated(25))),
    Row("video, a clock that jumps", video("a.mkv", None, milliseconds=PAUSE), "refused", "its clock jumps by 4.8 s"),
    Row("video, a clock that jumps, --source-rate", video("a.mkv", None, "--source-rate", "25", milliseconds=PAUSE),
        "told", "its clock jumps by 4.8 s", lambda folder: read_sequence_file(folder / "o").times is None),
    Row("video, a pause in a long clip", video("a.mkv", pictures(60), milliseconds=WITH_A_PAUSE), "told",
        "its clock jumps by 1.54 s after picture 20", both(close(pictures(60)), timed(WITH_A_PAUSE))),
    Row("video, mirrored", video("a.mp4", change=mirrored), "refused", "are shown mirrored"),
    Row("video, mirrored, --orientation stored", video("a.mp4", None, "--orientation", "stored", change=mirrored),
        "told", "states mirrored pictures: used as stored", close(pictures())),
    Row("video, AVI with pictures that refer to later ones", video("a.avi", pictures(20), options={"bf": "2"}), "told",
        "evenly spaced, 25 a second", lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, 25)),
    Row("video, a crop of Matroska", video("a.mkv", change=cropped), "refused", "PixelCropRight = "),
    Row("video, AVI with oblong pixels", stream(write_avi, "a.avi"), "told", "times as wide as high", FOUR),
    Row("video, AVI meant for a part of a window", stream(write_avi, "a.avi", rcFrame=(0, 0, 64, 48)), "told",
        "meant for a part of a window", FOUR),
    Row("video, a scrambled transport stream", stream(write_transport, "a.ts", stream_type=0x1B,
        transport_scrambling_control=2), "refused", "the pictures are encrypted"),
    Row("video, a transport stream with a second view", stream(write_transport, "a.ts", stream_type=0x1B,
        MVC_extension=1), "refused", "a second view of the same pictures is not decoded"),
    Row("video, a scrambled DVD", stream(write_program, "a.mpg", video=True, PES_scrambling_control=1), "refused",
        "the pictures are encrypted"),
    Row("video, film as video of 30 a second, without a mark", pulled_down, "told", "in 16 of 40 frames"),
    Row("video, two pictures exchanged", video("a.mp4", exchanged_frames(slow())), "told", "exchanged-frames"),
]  # fmt: skip
