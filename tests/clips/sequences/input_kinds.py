"""How the inputs of `inputs_tried.py` are made, and how an outcome is checked."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))
from common_folder import written
from made_videos import CAMERA, HEIGHT, WIDTH, picture, pictures, write
from raw_sources import colmap, stereomis
from test_stated_depth import recording as with_depth
from test_stated_depth import true_depth

from endotsr.clips.opencv import read_png, write_png
from endotsr.clips.opencv.pictures import write_jpeg
from endotsr.clips.sequences.sequence_file import FILE_NAME, read_sequence_file


class Row(NamedTuple):
    """One kind of input."""

    kind: str
    make: Callable[[Path], list[str]]  # makes the input in a folder; the words of the command
    expected: str  # right, told or refused
    said: str = ""  # a part of what is printed
    check: Callable[[Path], bool] = lambda folder: True  # of what was written


class Outcome(NamedTuple):
    """What a command did."""

    row: Row
    command: str
    outcome: str
    message: str


def close(frames, tolerance=10.0):
    """The written pictures are these."""

    def check(folder: Path) -> bool:
        files = sorted((folder / "o/images").iterdir())
        apart = [np.abs(read_png(f).astype(int) - p.astype(int)).mean() for f, p in zip(files, frames, strict=True)]
        return max(apart) < tolerance

    return check


def timed(milliseconds):
    """The written times are these."""
    return lambda folder: np.allclose(
        read_sequence_file(folder / "o").times or [], np.array(milliseconds) / 1e3, atol=2e-3
    )


def size(width, height):
    """The written size is this, and so is that of the camera."""

    def check(folder: Path) -> bool:
        camera, seen = read_sequence_file(folder / "o").camera, read_png(folder / "o/images/000000.png")
        return (camera.width, camera.height) == (width, height) == (seen.shape[1], seen.shape[0])

    return check


def prepare(name: str, *words: str, camera=CAMERA):
    return lambda folder: ["prepare", str(folder / name), "--out", str(folder / "o"), *camera, *words]


def video(name: str, frames=None, *words: str, change=lambda path: None, **how):
    """A video as the input of `prepare`."""

    def make(folder: Path) -> list[str]:
        write(folder / name, pictures() if frames is None else frames, **how)
        change(folder / name)
        return prepare(name, *words)(folder)

    return make


def codec(kind: str, name: str, code: str, layout="yuv420p", **how) -> Row:
    return Row(f"video, {kind}", video(name, None, codec=code, layout=layout, **how), "right", "", close(pictures()))


def cut(part: float, whole=None):
    def change(path: Path) -> None:
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * part)])

    return change


def scratched(path: Path) -> None:
    """Bytes in the middle of the pictures are overwritten."""
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 4000] = np.random.default_rng(0).integers(0, 256, 4000).astype(np.uint8).tobytes()
    path.write_bytes(data)


def files(folder: Path, name: str, frames, ending="png", start=0) -> None:
    (folder / name).mkdir()
    for i, frame in enumerate(frames):
        path = folder / name / f"{i + start:04d}.{ending}"
        write_png(path, frame) if ending == "png" else write_jpeg(path, frame)


def folder_of(frames, *words: str, ending="png", change=lambda folder: None):
    def make(folder: Path) -> list[str]:
        files(folder, "clip", frames, ending)
        change(folder)
        return prepare("clip", *words)(folder)

    return make


def masked(frames, *words: str, count=12, change=lambda folder: None):
    changed = change

    def change(folder: Path) -> None:
        files(folder, "m", frames[:count])
        changed(folder / "m")

    def make(folder: Path) -> list[str]:
        return [*folder_of(pictures(), change=change)(folder), "--masks", str(folder / "m"), *words]

    return make


def mask(value=255):
    plane = np.zeros((HEIGHT, WIDTH), np.uint8)
    plane[:, :40] = value
    return plane


def united_masks(folder: Path) -> list[str]:
    """Two sets of masks, each of which excludes a part of what both do."""
    parts = [mask(), mask()]
    parts[0][:, 20:], parts[1][:, :20] = 0, 0
    for name, part in zip("ab", parts):
        files(folder, name, [part] * 12)
    words = folder_of(pictures())(folder)
    return [*words, "--masks", str(folder / "a"), "--unite-masks", str(folder / "b")]


def half_excluded(folder: Path) -> bool:
    return abs((read_png(folder / "o/masks/000003.png") > 0).mean() - 40 / WIDTH) < 0.01


def rewritten(folder: Path, change, ending="png", **how) -> None:
    """Every picture of a folder again, changed by Pillow."""
    from PIL import Image

    for k, file in enumerate(sorted(folder.iterdir())):
        with Image.open(file) as opened:
            made = change(opened.copy(), k)
        file.unlink()
        made.save(file.with_suffix(f".{ending}"), **how)


def transparent(columns: int):
    """The first columns of the pictures are transparent."""

    def changed(opened, _):
        from PIL import Image

        alpha = np.full(opened.size[::-1], 255, np.uint8)
        alpha[:, :columns] = 0
        opened.putalpha(Image.fromarray(alpha))
        return opened

    return lambda folder: rewritten(folder / "clip", changed)


def as_transparency(folder: Path) -> None:
    """Masks as drawing programs write them: black, and transparent where nothing is marked."""
    from PIL import Image

    def changed(opened, _):
        black = Image.new("RGB", opened.size)
        black.putalpha(opened)
        return black

    rewritten(folder, changed)


def palette(folder: Path) -> None:
    rewritten(folder / "clip", lambda opened, _: opened.quantize(256))


def cmyk(folder: Path) -> None:
    rewritten(folder / "clip", lambda opened, _: opened.convert("CMYK"), "jpg", quality=95)


def converted(ending: str, **how):
    return lambda folder: rewritten(folder / "clip", lambda opened, _: opened, ending, **how)


def blank():
    from PIL import Image

    return Image.new("RGB", (WIDTH, HEIGHT))


def shortened(ending: str):
    """The last twentieth of the fourth file is missing."""

    def change(folder: Path) -> None:
        converted(ending)(folder)
        file = folder / f"clip/0003.{ending}"
        file.write_bytes(file.read_bytes()[: int(0.95 * file.stat().st_size)])

    return change


def every_second_jpg(folder: Path) -> None:
    for file in sorted((folder / "clip").iterdir())[::2]:
        pixels = read_png(file)
        file.unlink()
        write_jpeg(file.with_suffix(".jpg"), pixels)


def without_zeros(folder: Path) -> None:
    for file in sorted((folder / "clip").iterdir()):
        file.rename(file.with_name(f"{int(file.stem)}.png"))


def two_streams(folder: Path) -> list[str]:
    """Two views as two streams of one file."""
    import av

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


def high_definition(tagged: bool):
    """Pictures of 1280x720 with the matrix of BT.709, which the file states or not."""

    def make(folder: Path) -> list[str]:
        import av

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

    return make


def exif(folder: Path) -> None:
    from PIL import Image

    for file in (folder / "clip").iterdir():
        with Image.open(file) as opened:
            data = opened.getexif()
            data[0x0112] = 6
            opened.save(file, exif=data, quality=95)


def renamed(folder: Path) -> None:
    (folder / "clip/0005.png").rename(folder / "clip/0105.png")


def depth(values, *words, name="depth", kind="npy"):
    def make(folder: Path) -> list[str]:
        return [*with_depth(folder, values, name, kind), *words]

    return make


def depth_is_true(folder: Path) -> bool:
    entry = read_sequence_file(folder / "o").depth
    return (
        entry is not None and np.abs(read_png(folder / "o/depth/000002.png") * entry.scale - true_depth(2)).max() < 0.03
    )


def one_camera(values, *words, points=0):
    """A clip from one camera with the files of a network, and true depth at some points beside it."""

    def make(folder: Path) -> list[str]:
        import test_relative_depth as one

        where, given = one.clip(folder, values)
        if points:
            one.sparse(where, points)
        return ["depth", str(where), "--given", str(given), "--kind", "relative", *words]

    return make


def public(layout: str, *words: str, change=lambda raw: None, **how):
    """A public layout; see `public_layouts`."""

    def make(folder: Path) -> list[str]:
        import public_layouts

        getattr(public_layouts, layout)(folder / "raw", **how)
        change(folder / "raw")
        return prepare("raw", *words, camera=())(folder)

    return make


def centred(folder: Path) -> bool:
    """The written principal point is the middle of the picture: half a pixel was added once."""
    camera = read_sequence_file(folder / "o").camera
    return abs(camera.cx - WIDTH / 2) < 1e-3 and abs(camera.cy - HEIGHT / 2) < 1e-3


def calibrated(name: str, text: Callable[[], str], *words: str):
    """Pictures with a calibration of another program."""

    def make(folder: Path) -> list[str]:
        files(folder, "clip", pictures())
        (folder / name).write_text(text())
        return prepare("clip", "--calibration", str(folder / name), *words, camera=())(folder)

    return make


def ros_text(**changes) -> str:
    from test_calibrations import K, ros

    return ros(K, [0.0] * 5, **changes)


def kalibr_text(**changes) -> str:
    from test_calibrations import kalibr

    return kalibr(pair=False, distortion_coeffs=[0.0] * 4, **changes)


MATRIX = "100 0 63.5\n0 101 47.5\n0 0 1\n"
OPENCV = """%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [100., 0., 63.5, 0., 101., 47.5, 0., 0., 1.]
"""


def common(*words: str, command="check", **changes):
    """A folder in the common format."""

    def make(folder: Path) -> list[str]:
        change = changes.pop("change", None)
        written(folder / "clip", **changes)
        if change:
            change(folder / "clip")
        return [command, str(folder / "clip"), *words]

    return make


def each(name, change):
    def done(clip: Path) -> None:
        for file in sorted((clip / name).iterdir()):
            write_png(file, change(read_png(file)))

    return done


def text(old, new):
    return lambda clip: (clip / FILE_NAME).write_text((clip / FILE_NAME).read_text().replace(old, new))


def frozen(clip: Path) -> None:
    first = read_png(clip / "images/000000.png")
    each("images", lambda x: first)(clip)


def stereomis_folder(*words, change=lambda raw: None):
    def make(folder: Path) -> list[str]:
        stereomis(folder / "raw")
        change(folder / "raw")
        return prepare("raw", *words, camera=())(folder)

    return make


def colmap_folder(*words):
    def make(folder: Path) -> list[str]:
        colmap(folder / "raw", False)
        return prepare("raw", *words, camera=())(folder)

    return make


def scope(folder: Path) -> list[str]:
    """A round field of view with an instrument, as a video."""
    from test_propose_masks import scene, through_a_scope

    write(folder / "a.mp4", through_a_scope(scene("pulling")[0])[0], options={"crf": "20"})
    return ["masks", str(folder / "a.mp4"), "--out", str(folder / "o")]


def view_is_kept(folder: Path) -> bool:
    return all(0.3 < (read_png(file) > 0).mean() < 0.8 for file in (folder / "o/masks").iterdir())


def exported(name: str, *words: str):
    def make(folder: Path) -> list[str]:
        sys.path.insert(0, str(Path(__file__).parents[2] / "results" / "export"))
        from made_up_model import moving_scene

        from endotsr.results.export.files import export

        export(moving_scene(), folder / "a.npz")
        return ["export", str(folder / "a.npz"), "--out", str(folder / name), *words]

    return make


def text_file(name: str, content: bytes):
    def make(folder: Path) -> list[str]:
        (folder / name).write_bytes(content)
        return prepare(name)(folder)

    return make


def joined(folder: Path) -> list[str]:
    """A transport stream whose pictures change their size in the middle."""
    small = [picture(i, 96, 64) for i in range(6)]
    parts = [write(folder / f"{k}.ts", frames, "mpeg2video") for k, frames in enumerate((pictures(6), small))]
    (folder / "a.ts").write_bytes(b"".join(part.read_bytes() for part in parts))
    return prepare("a.ts")(folder)


def trailing(count):
    return lambda folder: read_sequence_file(folder / "o").frames == count
