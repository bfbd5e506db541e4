"""Every field of a format is used, refused by name, harmless with a reason, or noted as unknown."""

import pytest
from field_formats import FORMATS as NAMED
from field_formats import Format
from file_formats import FILES
from layout_formats import LAYOUTS
from layout_formats import OTHER_NAMES as OF_FOLDERS
from stream_formats import BY_PILLOW, STREAMS
from video_formats import REPEATED, TRACKS

from endotsr.clips.formats.inventory import Inventory
from endotsr.errors import InputError

FORMATS = NAMED | FILES | TRACKS | LAYOUTS | STREAMS
USED = [(name, field) for name, found in FORMATS.items() for field in found.changed]
REFUSED = [(name, field) for name, found in FORMATS.items() for field in found.refused]


def outcome(found: Format, folder, keys) -> object:
    """The result of the reader, or its refusal."""
    folder.mkdir()
    found.write(folder, keys)
    try:
        return found.read(folder)
    except InputError as error:
        return str(error).replace(str(folder), "")


def matters(found: Format, field: str, folder) -> bool:
    """Whether another value of a field gives another result."""
    start = {field: found.start[field]} if field in found.start else {}
    before = outcome(found, folder / "a", found.base | start)
    return outcome(found, folder / "b", found.base | {field: found.changed[field]}) != before


@pytest.mark.parametrize(("name", "field"), USED)
def test_a_used_field_changes_the_result(name, field, tmp_path):
    assert FORMATS[name].inventory.reason(FORMATS[name].inventory.used, field) is not None
    assert matters(FORMATS[name], field, tmp_path)


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_is_read_alike_twice(name, tmp_path):
    """Otherwise every field would seem to change the result."""
    found = FORMATS[name]
    assert outcome(found, tmp_path / "a", found.base) == outcome(found, tmp_path / "b", found.base)


@pytest.mark.parametrize(("name", "field"), REFUSED)
def test_a_refused_field_is_refused_by_name(name, field, tmp_path):
    found = FORMATS[name]
    assert isinstance(outcome(found, tmp_path / "a", found.base), tuple)
    said = outcome(found, tmp_path / "b", found.base | {field: found.refused[field]})
    assert isinstance(said, str) and field in said and found.inventory.reason(found.inventory.refused, field) in said


@pytest.mark.parametrize(("name", "field"), [(name, field) for name, found in FORMATS.items() for field in found.told])
def test_a_field_that_is_not_applied_is_told(name, field, tmp_path):
    found = FORMATS[name]
    said = outcome(found, tmp_path / "a", found.base | {field: found.told[field]})
    text = found.inventory.reason(found.inventory.told, field)
    assert isinstance(said, tuple) and any(f"{field}: {text}" in note for note in said[1]), said


@pytest.mark.parametrize("name", FORMATS)
def test_the_base_has_every_used_field_or_a_change_adds_it(name):
    """A field of the inventory without a change would be listed as used without proof."""
    found = FORMATS[name]
    patterns = [word for names in found.inventory.used for word in names.split()]
    tried = {*found.changed, *found.base}
    spelled = {"nerfstudio frame": {"camera_angle_x", "camera_angle_y"}, "ros": ALIASES, "ros echo": ALIASES,
               "opencv": OTHER_NAMES, "flat": OF_PLAIN_NUMBERS, "tiff": BY_LIBTIFF, "bmp": BY_PILLOW,
               "matlab": {"FocalLength", "PrincipalPoint"}, "bouguet": {"fc", "cc", "kc"},
               "trajectory": {"rvec_x", "rvec_y", "rvec_z"}, **REPEATED, **OF_FOLDERS}.get(name, set())  # fmt: skip
    for pattern in patterns:
        inventory = Inventory("", {pattern: "x"})
        known = pattern in spelled or any(inventory.reason(inventory.used, field) for field in tried)
        assert known, f"field_formats.py: give {name!r} a value of {pattern}, and another value that changes the clip"


ALIASES = {"image_width", "width", "image_height", "height", "camera_matrix", "K", "k", "distortion_coefficients", "D",
           "d", "rectification_matrix", "R", "r", "projection_matrix", "P", "p"}  # fmt: skip
# Read by libtiff without a statement of this package; GDAL_NODATA is one of the inputs tried.
BY_LIBTIFF = {"ColorMap", "SampleFormat", "FillOrder", "TileWidth", "TileLength", "TileOffsets", "TileByteCounts",
              "YCbCrSubSampling", "YCbCrPositioning", "YCbCrCoefficients", "ReferenceBlackWhite", "JPEGTables",
              "T4Options", "T6Options", "GrayResponseUnit", "GrayResponseCurve", "GDAL_NODATA"}  # fmt: skip
OF_PLAIN_NUMBERS = {"w", "h", "image_width", "image_height", "distortion_coefficients", "Distortion_Coefficients", "D",
                    "distCoeffs", "dist", "dist_coeffs", "dist_coeff", "distortion"}  # fmt: skip
OTHER_NAMES = {"camera_matrix", "Camera_Matrix", "K", "cameraMatrix", "distortion_coefficients",
               "Distortion_Coefficients", "D", "distCoeffs", "K1", "K2", "cameraMatrix1", "cameraMatrix2",
               "distCoeffs1", "distCoeffs2", "image_Width", "image_Height", "width", "height", "mtx", "camera_mtx",
               "intrinsic_matrix", "dist", "dist_coeffs", "dist_coeff", "distortion", "mtx1", "mtx2", "mtxL", "mtxR",
               "dist1", "dist2", "distL", "distR"}  # fmt: skip


@pytest.mark.parametrize("name", ["nerfstudio", "nerfstudio frame"])
def test_a_file_with_a_new_field_says_so(name, tmp_path):
    from endotsr.clips.sequences.layouts import describe

    found = FORMATS[name]
    found.write(tmp_path, found.base | {"lens_shading_map": [1, 2]})
    assert any("unknown here: lens_shading_map" in note for note in describe(tmp_path).notes)


@pytest.mark.parametrize("name", ["kalibr", "ros", "ros echo", "opencv", "flat", "ini", "matlab pair", "bouguet"])
def test_a_calibration_with_a_new_field_says_so(name, tmp_path):
    from endotsr.clips.formats.calibrations import calibrated

    found = FORMATS[name]
    found.write(tmp_path, found.base | {"thin_prism": 1})
    file = next(tmp_path.glob("file.*"), tmp_path)
    assert any("unknown here: thin_prism" in note for note in calibrated(file, 32, 24).notes)


@pytest.mark.parametrize(("name", "old"), [("mp4", "btrt"), ("mkv", "DisplayHeight")])
def test_a_video_with_a_new_field_says_so(name, old, tmp_path):
    """Another name is not known; DisplayHeight becomes an element of the same length."""
    found = FORMATS[name]
    new = "abcd" if name == "mp4" else None
    assert "unknown here" in str(outcome(found, tmp_path / "a", found.base | {"field": (old, new)}))


def test_a_neutral_value_of_a_refused_field_changes_nothing():
    inventory = Inventory("x", {"a": ""}, {"b": "no"}, {}, {"b": ("none",)})
    assert inventory.noted({"b": 0, "a": 1}, "f") == inventory.noted({"b": "none"}, "f") == []
    with pytest.raises(InputError, match="f: b = 1: no"):
        inventory.noted({"b": 1}, "f")
