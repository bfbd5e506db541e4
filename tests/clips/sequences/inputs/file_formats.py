"""Small files of formats whose fields are places, chunks, tags or boxes, and a change of each field that is used."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
from field_formats import FRAMES, HEIGHT, WIDTH, Format, Keys, pictures, result
from input_kinds import exif

from endotsr.clips.formats import picture_fields, pose_fields
from endotsr.clips.formats.colmap_model import MODELS
from endotsr.clips.formats.point_files import CLOUD, read_cloud
from endotsr.clips.formats.trajectory import read_trajectory
from endotsr.clips.formats.trajectory_lines import FIELDS as TRAJECTORY
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.source_options import SourceOptions
from endotsr.results.export.ply import GAUSSIAN, read_gaussians

CAMERA = (30.0, 31.0, 15.0, 11.0)
LENS = {"CAMERA_ID": 1, "MODEL": "PINHOLE", "WIDTH": WIDTH, "HEIGHT": HEIGHT, "PARAMS": list(CAMERA)}
IMAGE = {"QW": 1.0, "QX": 0.0, "QY": 0.0, "QZ": 0.0, "TX": 0.0, "TY": 0.0, "TZ": 0.0, "CAMERA_ID": 1, "NAME": "000.png",
         "POINT3D_ID": 7}  # fmt: skip
POINT = {"POINT3D_ID": 7, "X_": 0.1, "Y_": 0.2, "Z_": 5.0}


def write_model(folder: Path, camera: Keys, image: Keys, point: Keys, binary: bool) -> None:
    """A model of one camera, one point and two pictures, the second with the usual pose."""
    pictures(folder, "images")
    (folder / "sparse").mkdir()
    images = [image, IMAGE | {"NAME": "001.png", "TX": 1.0}]
    if binary:
        _write_binary(folder / "sparse", camera, images, point)
        return
    files = {
        "cameras": [[camera[k] for k in ("CAMERA_ID", "MODEL", "WIDTH", "HEIGHT")] + camera["PARAMS"]],
        "images": [row for k, one in enumerate(images) for row in (
            [k + 1, *(one[n] for n in ("QW", "QX", "QY", "QZ", "TX", "TY", "TZ", "CAMERA_ID", "NAME"))],
            [1.0, 2.0, one["POINT3D_ID"]])],
        "points3D": [[point[k] for k in ("POINT3D_ID", "X_", "Y_", "Z_")] + [9, 9, 9, 0.5, 1, 0]],
    }  # fmt: skip
    for name, rows in files.items():
        (folder / f"sparse/{name}.txt").write_text("".join(" ".join(map(str, row)) + "\n" for row in rows))


def _write_binary(folder: Path, camera: Keys, images: list[Keys], point: Keys) -> None:
    number = MODELS[camera["MODEL"]][0] if camera["MODEL"] in MODELS else 5
    head = struct.pack("<QiiQQ", 1, camera["CAMERA_ID"], number, camera["WIDTH"], camera["HEIGHT"])
    (folder / "cameras.bin").write_bytes(head + struct.pack(f"<{len(camera['PARAMS'])}d", *camera["PARAMS"]))
    rows = [struct.pack("<i7di", k + 1, *(float(one[n]) for n in ("QW", "QX", "QY", "QZ", "TX", "TY", "TZ")),
                        one["CAMERA_ID"]) + one["NAME"].encode() + b"\0"
            + struct.pack("<Qddq", 1, 1.0, 2.0, one["POINT3D_ID"]) for k, one in enumerate(images)]  # fmt: skip
    (folder / "images.bin").write_bytes(struct.pack("<Q", len(rows)) + b"".join(rows))
    place = [point[k] for k in ("POINT3D_ID", "X_", "Y_", "Z_")]
    (folder / "points3D.bin").write_bytes(
        struct.pack("<QQdddBBBdQii", 1, place[0], *map(float, place[1:]), 9, 9, 9, 0.5, 1, 1, 0)
    )


def colmap(which: str, binary: bool) -> Format:
    """The fields of one of the three files of a model."""
    base = {"camera": LENS, "image": IMAGE, "point": POINT}
    changed = {
        "camera": {"CAMERA_ID": 2, "MODEL": "OPENCV_FISHEYE", "WIDTH": 64, "HEIGHT": 48, "PARAMS": [33.0, 31, 15, 11]},
        "image": {name: 0.9 for name in ("QX", "QY", "QZ", "TX", "TY", "TZ")}
        | {"QW": -0.2, "CAMERA_ID": 5, "NAME": "002.png", "POINT3D_ID": -1},
        "point": {"POINT3D_ID": 8, "X_": 0.4, "Y_": 0.5, "Z_": 6.0},
    }[which]
    inventory = {"camera": pose_fields.COLMAP_CAMERA, "image": pose_fields.COLMAP_IMAGE,
                 "point": pose_fields.COLMAP_POINT}[which]  # fmt: skip

    def write_keys(folder: Path, keys: Keys) -> None:
        found = base | {which: keys}
        write_model(folder, found["camera"], found["image"], found["point"], binary)

    return Format(inventory, base[which], write_keys, told, changed, {})


def told(folder: Path) -> object:
    """What the source says, with its notes."""
    clip = describe(folder)
    return result(clip), [note.replace(str(folder), "").removeprefix(f"{folder.name}: ") for note in clip.notes]


def write_llff(folder: Path, keys: Keys) -> None:
    """Three poses; the keys are those of the second."""
    pictures(folder, "images")
    (folder / "images/003.png").unlink()
    (folder / "planes/003.png").unlink()
    (folder / "planes").rename(folder / "depth")
    (folder / "masks/003.png").unlink()
    rows = np.zeros((FRAMES, 17))
    for i in range(FRAMES):
        one = keys if i == 1 else LLFF_BASE
        hwf = np.array([[one["H"]], [one["W"]], [one["f"]]])
        rows[i] = [*np.hstack([np.array(one["R"]), np.array(one["t"]).reshape(3, 1), hwf]).ravel(), 1, 9]
    np.save(folder / "poses_bounds.npy", rows)


LLFF_BASE = {"R": np.eye(3).tolist(), "t": [0, 0, 1.0], "H": HEIGHT, "W": WIDTH, "f": 30.0}
LLFF_CHANGES = {"R": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "t": [0, 0, 2.0], "H": 48, "W": 64, "f": 33.0}


def write_columns(folder: Path, keys: Keys) -> None:
    """Two poses with a head line that names the keys."""
    later = COLUMNS | {"stamp": 9}
    rows = [" ".join(map(str, row)) for row in (keys, keys.values(), later.values())]
    (folder / "t.txt").write_text("# " + "\n".join(rows))


COLUMNS = {"stamp": 4, "tx": 1, "ty": 2, "tz": 3, "qx": 0, "qy": 0, "qz": 0, "qw": 1}
COLUMNS_CHANGED = {"stamp": 5, "tx": 9, "ty": 9, "tz": 9, "qx": 0.1, "qy": 0.1, "qz": 0.1, "qw": 0.5}


def trajectory(folder: Path) -> object:
    found = read_trajectory(folder / "t.txt", "mm")
    return found.stamps.tolist(), [(p.rotation.tolist(), p.translation.tolist()) for p in found.poses]


def write_vertices(folder: Path, keys: Keys) -> None:
    """Two vertices in big-endian order: one with the keys, one with twice their values."""
    names = [name for name, value in keys.items() if value is not None]
    head = "".join(f"property float {name}\n" for name in names)
    rows = np.array([[keys[name] * k for name in names] for k in (1, 2)], ">f4")
    text = f"ply\nformat binary_big_endian 1.0\nelement vertex 2\n{head}end_header\n"
    (folder / "a.ply").write_bytes(text.encode() + rows.tobytes())


SPLAT_NAMES = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"
SPLAT = {name: 0.5 for name in SPLAT_NAMES.split()}
SPLAT |= {f"f_rest_{k}": 0.1 for k in range(9)}


def gaussians(folder: Path) -> object:
    return tuple(None if part is None else part.tolist() for part in read_gaussians(folder / "a.ply"))


def chunk(kind: str, content: bytes) -> bytes:
    body = kind.encode() + content
    return struct.pack(">I", len(content)) + body + struct.pack(">I", zlib.crc32(body))


def write_png_chunks(folder: Path, keys: Keys) -> None:
    """Pictures with a palette from these chunks, in the order of the format."""
    order = [
        "IHDR", *(name for name in keys if name not in ("IHDR", "PLTE", "tRNS", "IDAT", "IEND")), "PLTE", "tRNS",
        "IDAT", "IEND",
    ]  # fmt: skip
    data = b"".join(chunk(name, keys[name]) for name in order if keys.get(name) is not None)
    for k in range(2):
        (folder / f"{k}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + data)


PIXELS = bytes((b"\0" + bytes(range(WIDTH))) * HEIGHT)
PNG = {"IHDR": struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 3, 0, 0, 0), "PLTE": bytes(range(96)) * 3,
       "IDAT": zlib.compress(PIXELS), "gAMA": struct.pack(">I", 100000), "IEND": b""}  # fmt: skip
PNG_CHANGES = {"IHDR": struct.pack(">IIBBBBB", WIDTH - 1, HEIGHT, 8, 3, 0, 0, 0), "PLTE": bytes(range(96, 192)) * 3,
               "IDAT": zlib.compress(PIXELS[::-1]), "tRNS": b"\0", "acTL": struct.pack(">II", 2, 0),
               "eXIf": exif(6)[6:], "sRGB": b"\0", "IEND": None}  # fmt: skip
PNG_TOLD = {"iCCP": b"P3\0\0" + zlib.compress(b"Display P3"), "gAMA": struct.pack(">I", 100000),
            "cHRM": struct.pack(">8I", *range(8)), "cICP": bytes([9, 13, 0, 1]), "sTER": b"\1",
            "pHYs": struct.pack(">IIB", 1, 2, 0)}  # fmt: skip


def saved(kind: str, **how) -> bytes:
    """A small picture in a format."""
    from PIL import Image

    colours = np.random.default_rng(how.pop("seed", 0)).integers(
        0, 255, (HEIGHT, WIDTH, how.pop("channels", 3)), np.uint8
    )
    file = io.BytesIO()
    Image.fromarray(colours).save(file, kind, **how)
    return file.getvalue()


def write_whole(ending: str):
    """Two pictures: the first has the bytes of the last key."""

    def write_bytes(folder: Path, keys: Keys) -> None:
        for k in range(2):
            (folder / f"{k}.{ending}").write_bytes([*keys.values()][k - 1])

    return write_bytes


def whole(inventory, ending: str, base: bytes, changed: dict, refused: dict, said: dict) -> Format:
    return Format(inventory, {"file": base}, write_whole(ending), told, changed, refused, said)


def bare_jpeg(**how) -> bytes:
    """A JPEG without the segment of JFIF, which would state the colours."""
    data = saved("JPEG", quality=95, **how)
    return data[:2] + data[20:]


def segment(marker: int, content: bytes) -> bytes:
    """The usual JPEG with one more segment."""
    data = bare_jpeg()
    return data[:2] + bytes([0xFF, marker]) + struct.pack(">H", len(content) + 2) + content + data[2:]


def frames(kind: str) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    shown = [Image.fromarray(np.full((HEIGHT, WIDTH, 3), 90 * k, np.uint8)) for k in range(2)]
    shown[0].save(file, kind, save_all=True, append_images=shown[1:])
    return file.getvalue()


def tiff(number: int = 0, value: object = None, **how) -> bytes:
    """A TIFF with one more tag."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    tags = ImageFileDirectory_v2()
    if number:
        tags[number] = value
    return saved("TIFF", tiffinfo=tags, **how)


def patched(number: int, value: int, data: bytes | None = None) -> bytes:
    """A little-endian TIFF in which one tag has another value."""
    changed = bytearray(data or tiff())
    (place,) = struct.unpack_from("<I", changed, 4)
    for k in range(struct.unpack_from("<H", changed, place)[0]):
        entry = place + 2 + 12 * k
        if struct.unpack_from("<H", changed, entry)[0] == number:
            kind, count = struct.unpack_from("<HI", changed, entry + 2)
            where = (
                entry + 8 if count * (2 if kind == 3 else 4) <= 4 else struct.unpack_from("<I", changed, entry + 8)[0]
            )
            struct.pack_into("<H" if kind == 3 else "<I", changed, where, value)
    return bytes(changed)


TIFF_CHANGES = {
    "ImageWidth": patched(256, WIDTH - 1), "ImageLength": patched(257, HEIGHT - 1), "BitsPerSample": patched(258, 16),
    "Compression": patched(259, 5), "PhotometricInterpretation": patched(262, 6), "StripOffsets": patched(273, 60),
    "SamplesPerPixel": patched(277, 1), "RowsPerStrip": patched(278, 1),
    "StripByteCounts": patched(279, 9, saved("TIFF", compression="tiff_lzw")),
    "PlanarConfiguration": patched(284, 2), "Predictor": patched(317, 1, saved("TIFF", compression="tiff_lzw",
        tiffinfo={317: 2})), "ExtraSamples": saved("TIFF", channels=4),
}  # fmt: skip
TIFF_TOLD = {"ICCProfile": saved("TIFF", icc_profile=b"Display P3" * 20), "SubIFDs": tiff(330, 8),
             "WhitePoint": tiff(318, (0.3, 0.4)), "GDAL_METADATA": tiff(42112, "<a/>")}  # fmt: skip
FILES = {
    **{f"colmap {which} {'binary' if binary else 'text'}": colmap(which, binary)
       for which in ("camera", "image", "point") for binary in (False, True)},
    "llff": Format(pose_fields.LLFF, LLFF_BASE, write_llff, lambda folder: result(describe(folder, SourceOptions())),
                   LLFF_CHANGES, {}),
    "trajectory": Format(TRAJECTORY, COLUMNS, write_columns, trajectory, COLUMNS_CHANGED, {}),
    "points": Format(CLOUD, {"x": 1, "y": 2, "z": 3}, write_vertices, lambda f: (read_cloud(f / "a.ply")[0].tolist(),),
                     {"x": 9, "y": 9, "z": 9}, {}),
    "gaussians": Format(GAUSSIAN, SPLAT, write_vertices, gaussians,
                        {name: 0.7 for name in SPLAT} | {"filter_3D": 2.0}, {"motion_0": 1.0, "trbf_center": 0.5}),
    "png": Format(picture_fields.PNG, PNG, write_png_chunks, told, PNG_CHANGES, {}, PNG_TOLD),
    "jpeg": whole(picture_fields.JPEG, "jpg", bare_jpeg(), {"SOF": bare_jpeg(seed=1),
                  "Adobe": segment(0xEE, b"Adobe\0\x64\0\0\0\0\0"), "Exif": segment(0xE1, exif(6))}, {},
                  {"ICC_PROFILE": saved("JPEG", icc_profile=b"Display P3" * 20), "ColorSpace": segment(0xE1,
                   exif(space=65535)), "MPF": segment(0xE2, b"MPF\0")}),
    "webp": whole(picture_fields.WEBP, "webp", saved("WEBP", lossless=True), {"VP8L": saved("WEBP", lossless=True,
                  seed=1), "VP8": saved("WEBP"), "VP8X": saved("WEBP", lossless=True, exif=exif(6)),
                  "EXIF": saved("WEBP", lossless=True, exif=exif(6)), "ALPH": saved("WEBP", channels=4),
                  "ANIM": frames("WEBP"), "ANMF": frames("WEBP")}, {},
                  {"ICCP": saved("WEBP", lossless=True, icc_profile=b"Display P3" * 20),
                   "ColorSpace": saved("WEBP", lossless=True, exif=exif(space=65535))}),
    "tiff": whole(picture_fields.TIFF, "tif", tiff(), TIFF_CHANGES, {}, TIFF_TOLD),
}  # fmt: skip
