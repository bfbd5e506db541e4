"""Rows of `inputs_tried.py` about videos: containers, codecs, rates, interlacing, marks, damage."""

import struct
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
from builders import builder
from input_kinds import EXCHANGED, GROUPS, TWICE, changed_bytes, cut, hidden_lead_in, prepare, video
from input_rows import ALIKE, Row, both, close, refused, right, size, timed, told
from made_videos import HEIGHT, INTERLACED, UNEVEN, WIDTH, picture, pictures, turn, woven, write
from stream_formats import write_avi, write_program, write_transport

from endotsr.clips.opencv.png import read_png
from endotsr.clips.sequences.sequence_file import read_sequence_file


def rated(rate: float):
    return lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, rate, rtol=1e-2)


def codec(kind: str, name: str, code: str, layout="yuv420p", **how) -> Row:
    return right(f"video, {kind}", video(name, None, codec=code, layout=layout, **how), ALIKE)


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


def scratched(data: bytes) -> bytes:
    """Bytes in the middle of the pictures are overwritten."""
    middle = len(data) // 2
    return data[:middle] + np.random.default_rng(0).bytes(4000) + data[middle + 4000 :]


def two_streams(folder: Path) -> list[str]:
    """Two views as two streams of one file."""
    with av.open(str(folder / "a.mkv"), "w") as container:
        streams = [container.add_stream("libx264", rate=25) for _ in range(2)]
        for stream in streams:
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for k, stream in enumerate(streams):
            for shown in pictures():
                moved = np.roll(shown, -20 * k, axis=1)
                container.mux(stream.encode(av.VideoFrame.from_ndarray(moved, format="rgb24")))
            container.mux(stream.encode())
    return prepare("a.mkv")(folder)


def joined(folder: Path) -> list[str]:
    """A transport stream whose pictures change their size in the middle."""
    small = [picture(i, 96, 64) for i in range(6)]
    parts = [write(folder / f"{k}.ts", frames, "mpeg2video") for k, frames in enumerate((pictures(6), small))]
    (folder / "a.ts").write_bytes(b"".join(part.read_bytes() for part in parts))
    return prepare("a.ts")(folder)


PULLED_DOWN = [picture(i - i // 5) for i in range(40)]
WITH_A_PAUSE = [40 * i + 1500 * (i > 20) for i in range(60)]
PAUSE = [*range(0, 240, 40), *range(5000, 5240, 40)]  # milliseconds


@builder
def renamed_video(folder: Path, name: str, kind: str, **how) -> list[str]:
    """A video under a name that does not end like one."""
    write(folder / f"a.{kind}", pictures(), **how).rename(folder / name)
    return prepare(name)(folder)


def mirrored(data: bytes) -> bytes:
    """The matrix of the track of an MP4 mirrors the pictures."""
    place = data.index(b"tkhd") + 44
    return data[:place] + struct.pack(">i", -65536) + data[place + 4 :]


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
    codec("H.264, avi", "a.avi", "libx264", options={"bf": "0"}),
    codec("H.264, camera stream .mts", "a.m2ts", "libx264"),
    codec("H.264 4:4:4", "a.mp4", "libx264", "yuv444p"),
    codec("H.264 10 bit", "a.mkv", "libx264", "yuv420p10le"),
    codec("H.264 full range", "a.mp4", "libx264", "yuvj420p"),
    codec("H.264 with B-frames", "a.mp4", "libx264", options={"bf": "3", "g": "12"}),
    codec("H.265, mp4", "a.mp4", "libx265"),
    codec("AV1, mkv", "a.mkv", "libsvtav1"),
    codec("VP8, webm", "a.webm", "libvpx"),
    codec("VP9, webm", "a.webm", "libvpx-vp9"),
    codec("MPEG-1", "a.mpg", "mpeg1video", options={"b": "4000000"}),
    codec("MPEG-2, transport stream", "a.ts", "mpeg2video", options={"b": "4000000"}),
    codec("MPEG-4 part 2, avi", "a.avi", "mpeg4", options={"b": "4000000"}),
    codec("WMV 8, wmv", "a.wmv", "wmv2", options={"b": "4000000"}),
    codec("Motion JPEG, avi", "a.avi", "mjpeg", "yuvj420p"),
    codec("Motion JPEG, mov", "a.mov", "mjpeg", "yuvj420p"),
    codec("ProRes, mov", "a.mov", "prores_ks", "yuv422p10le"),
    codec("HuffYUV, avi", "a.avi", "huffyuv", "rgb24"),
    right("video, 4:2:0 of odd size", video("a.mkv", [picture(i, 127, 95) for i in range(12)], codec="ffv1"), size(127,
        95)),
    right("video, 12 bit", video("a.mkv", codec="libx265", layout="yuv420p12le"), ALIKE),
    right("video, RGB of 16 bit", video("a.mkv", codec="ffv1", layout="gbrp16le"), close(pictures(), 1)),
    refused("GIF", video("a.gif", None, codec="gif", layout="rgb8"), "no known layout"),
    right("video of a recorder, .VOB", renamed_video("A.VOB", kind="mpg", codec="mpeg2video", options={"b": "4000000"}),
        ALIKE),
    right("video without an ending", renamed_video("recording", kind="mkv"), ALIKE),
    right("video, .flv", video("a.flv"), ALIKE),
    *(told(f"video, interlaced {kind}", video(name, woven(), codec=code, options=options),
        "is interlaced: deinterlaced", deinterlaced(DEINTERLACED)) for kind, (name, code,
        options) in INTERLACED.items()),
    *(told(f"video, uneven times, {kind}", video(f"a.{kind}", None, milliseconds=UNEVEN),
        "not evenly spaced (0.033 to 0.633 s apart)", both(timed(UNEVEN), rated(11 / 1.333))) for kind in ("mkv",
        "mp4")),
    told("video, uneven times, thinned by --rate", video("a.mkv", None, "--rate", "2", milliseconds=UNEVEN),
        "by their times", close([picture(i) for i in (0, 4, 7)])),
    told("video, uneven times, --source-rate", video("a.mkv", None, "--source-rate", "10", milliseconds=UNEVEN),
        "10 a second", lambda folder: read_sequence_file(folder / "o").times is None),
    told("video, 60 a second thinned to 20", video("a.mp4", None, "--rate", "20", rate=60), "4 of 12 frames",
        both(close([picture(i) for i in (0, 3, 6, 9)]), rated(20))),
    refused("video, --rate above its own", video("a.mp4", None, "--rate", "50"), "the source has 25 frames"),
    *(told(f"video, rotation of {degrees} degrees, --orientation {way}", video("a.mp4", None, "--orientation", way,
        change=lambda p, d=degrees: turn(p, d)), "states a rotation",
        turned_clockwise(degrees if way == "turned" else 0)) for degrees, way in ((90, "turned"), (180, "turned"), (270,
        "turned"), (90, "stored"))),
    refused("video, rotation of 90 degrees", video("a.mp4", change=lambda path: turn(path, 90)),
        "--orientation turned"),
    told("video, pixels that are not square", video("a.mkv", shape=Fraction(16, 15)), "times as wide as high"),
    refused("video, high dynamic range (PQ)", video("a.mkv", codec="libx265", layout="yuv420p10le", transfer=16),
        "high dynamic range (PQ)"),
    refused("video, black", video("a.mp4", [picture(0) * 0] * 8),
        "8 of 8 frames are black, white or of one colour: 000000, 000001"),
    refused("video, one colour", video("a.mp4", [picture(0) * 0 + np.uint8(90)] * 8), "of one colour"),
    refused("video, frozen", video("a.mp4", [picture(0)] * 8), "all 8 frames are one picture"),
    told("video, a black second in it", video("a.mp4", [*pictures(9), *[picture(0) * 0] * 3]), "black-frame"),
    told("video, cut inside", video("a.mp4", [*pictures(6), *[picture(i)[::-1, ::-1].copy() for i in range(6)]]),
        "000006 does not resemble 000005"),
    told("video, a frame repeated", video("a.mp4", [picture(i - (i > 2)) for i in range(12)]), "repeats 000002"),
    told("video, every third frame repeated", video("a.mp4", [picture(i - i // 3) for i in range(12)]),
        "1 of every 3 frames repeat"),
    told("video, two streams", two_streams, "2 video streams: one is read", ALIKE),
    told("video, with transparency", video("a.mov", None, codec="png", layout="rgba"), "transparency is ignored",
        ALIKE),
    right("video, high definition, BT.709", video("a.mp4", WIDE, options={"qp": "4"}, matrix="ITU709", colorspace=1),
        close(WIDE, 3)),
    told("video, high definition, no matrix of colour", video("a.mp4", WIDE, options={"qp": "4"}, matrix="ITU709"),
        "BT.601 is assumed, but players assume BT.709", close(WIDE)),
    right("video, one picture", video("a.mp4", pictures(1)), lambda folder: read_sequence_file(folder / "o").frames ==
        1),
    refused("video, truncated mp4, index at the end", video("a.mp4", change=cut(0.7)), "(moov) is missing"),
    refused("video, truncated mp4, index in front", video("a.mp4", pictures(40), options={"bf": "0"},
        container={"movflags": "faststart"}, change=cut(0.7)), "truncated or damaged"),
    refused("video, damaged H.264", video("a.mp4", pictures(40), options={"qp": "4"}, change=changed_bytes(scratched)),
        "picture"),
    refused("video, size changes", joined, "use one size"),
    refused("video, linear light", video("a.mp4", layout="yuv444p", transfer=8), "linear light"),
    told("video, colours of BT.2020", video("a.mkv", codec="libx265", layout="yuv420p10le", primaries=9),
        "states BT.2020 colours"),
    told("video, every picture twice, coded", video("a.mp4", TWICE, options={"crf": "28"}),
        "every second frame repeats the one before (20 of 40 frames"),
    right("video, every picture twice, --frames ::2", video("a.mp4", TWICE, "--frames", "::2"), close(TWICE[::2])),
    told("video, 24 a second stored as 30", video("a.mp4", PULLED_DOWN, options={"crf": "28"}),
        "1 of every 5 frames repeat"),
    right("video, lead-in hidden by an edit list", hidden_lead_in, close(pictures(24)[5:])),
    told("video, begins inside a group of pictures", video("a.ts", pictures(40), options=GROUPS,
        change=changed_bytes(lambda data: data[188 * 10 :])), "coded pictures cannot be decoded and are left out",
        close(pictures(40)[12:])),
    told("video, two files joined, the clock goes back", video("a.ts", pictures(40),
        change=changed_bytes(lambda data: data * 2)), "its clock goes back", both(close(pictures(40) * 2), rated(25))),
    refused("video, a clock that jumps", video("a.mkv", None, milliseconds=PAUSE), "its clock jumps by 4.8 s"),
    told("video, a clock that jumps, --source-rate", video("a.mkv", None, "--source-rate", "25", milliseconds=PAUSE),
        "its clock jumps by 4.8 s", lambda folder: read_sequence_file(folder / "o").times is None),
    told("video, a pause in a long clip", video("a.mkv", pictures(60), milliseconds=WITH_A_PAUSE),
        "its clock jumps by 1.54 s after picture 20", both(close(pictures(60)), timed(WITH_A_PAUSE))),
    refused("video, mirrored", video("a.mp4", change=changed_bytes(mirrored)), "are shown mirrored"),
    told("video, mirrored, --orientation stored", video("a.mp4", None, "--orientation", "stored",
        change=changed_bytes(mirrored)), "states mirrored pictures: used as stored", ALIKE),
    told("video, AVI with pictures that refer to later ones", video("a.avi", pictures(20), options={"bf": "2"}),
        "evenly spaced, 25 a second", lambda folder: np.isclose(read_sequence_file(folder / "o").frame_rate, 25)),
    refused("video, a crop of Matroska", video("a.mkv", change=changed_bytes(lambda data:
        data.replace(b"\x54\xb2\x81\x04", b"\x54\xdd\x81\x10", 1))), "PixelCropRight = "),
    told("video, AVI with oblong pixels", stream(write_avi, "a.avi"), "times as wide as high", FOUR),
    told("video, AVI meant for a part of a window", stream(write_avi, "a.avi", rcFrame=(0, 0, 64, 48)),
        "meant for a part of a window", FOUR),
    refused("video, a scrambled transport stream", stream(write_transport, "a.ts", stream_type=0x1B,
        transport_scrambling_control=2), "the pictures are encrypted"),
    refused("video, a transport stream with a second view", stream(write_transport, "a.ts", stream_type=0x1B,
        MVC_extension=1), "a second view of the same pictures is not decoded"),
    refused("video, a scrambled DVD", stream(write_program, "a.mpg", video=True, PES_scrambling_control=1),
        "the pictures are encrypted"),
    told("video, film as video of 30 a second, without a mark", pulled_down, "in 16 of 40 frames"),
    told("video, two pictures exchanged", video("a.mp4", EXCHANGED), "exchanged-frames"),
]  # fmt: skip
