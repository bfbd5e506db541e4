"""Files in each other's place, and files that were resized or mirrored: frames, masks, depth and coefficients."""

import msgspec
import numpy as np
import pytest

from data_folder import data_folder
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.prepare.lens import lens_warnings
from endotsr.clips.sequences.checks.copies import steps_between
from endotsr.clips.sequences.checks.depth import rim_finding
from endotsr.clips.sequences.checks.depth_rims import blended_rim
from endotsr.clips.sequences.checks.exchanged import exchanged_findings
from endotsr.clips.sequences.checks.halves import halves_finding
from endotsr.clips.sequences.checks.masks import mask_findings
from endotsr.clips.sequences.checks.polarity import MaskEvidence
from endotsr.clips.sequences.layouts import layout_of
from endotsr.clips.sequences.sampling import small_picture
from endotsr.clips.simulator.scenes import named_scene
from endotsr.clips.simulator.simulate import simulate
from endotsr.errors import InputError

MATRIX = np.array([[280.0, 0, 160], [0, 280, 128], [0, 0, 1]])


def simulated(name="pulling", frames=16):
    return simulate(msgspec.structs.replace(named_scene(name), width=192, height=160, frames=frames)).sequence


def recorded(folder="endonerf_pulling", part="images", count=24):
    return [read_picture(file) for file in sorted((data_folder(folder) / part).iterdir())[:count]]


def swapped(planes, i):
    found = list(planes)
    found[i], found[i + 1] = found[i + 1], found[i]
    return found


def exchanged(pictures):
    small = [small_picture(picture) for picture in pictures]
    names = [f"{i}.png" for i in range(len(small))]
    found = exchanged_findings(small, steps_between(small), names, np.ones(len(small), bool), "clip")
    return [(one.frame, one.what.split(":")[0]) for one in found]


def moving(i):
    """A soft pattern that moves by the same way from frame to frame."""
    x, y = np.meshgrid(np.arange(160), np.arange(120))
    red = 130 + 60 * np.sin(x / 9 + 0.2 * i) * np.cos(y / 11)
    return np.stack([red, red / 2, red / 2], axis=2).astype(np.uint8)


@pytest.mark.parametrize("place", [1, 5, 9])
def test_exchanged_frames_are_named_and_the_right_order_is_not(place):
    pictures = [moving(i) for i in range(12)]
    assert exchanged(pictures) == []
    assert exchanged(swapped(pictures, place)) == [(place, f"{place}.png and {place + 1}.png seem to be exchanged")]


def test_a_still_scene_and_a_few_frames_are_not_exchanged():
    rng = np.random.default_rng(0)
    still = [(moving(0) + rng.integers(0, 6, moving(0).shape)).astype(np.uint8) for _ in range(12)]
    assert exchanged(swapped(still, 5)) == []
    assert exchanged(swapped([moving(i) for i in range(6)], 2)) == []


@pytest.mark.parametrize(("folder", "place"), [("endonerf_pulling", 11), ("endonerf_cutting", 7)])
def test_exchanged_frames_of_recorded_clips(folder, place):
    pictures = recorded(folder)
    assert exchanged(pictures) == []
    assert [frame for frame, _ in exchanged(swapped(pictures, place))] == [place]


def test_exchanged_masks_are_named():
    masks = simulated().masks
    assert "exchanged-masks" not in [found.code for found in mask_findings(masks, "masks")]
    found = mask_findings(np.stack(swapped(masks, 6)), "masks")
    assert [(one.code, one.frame) for one in found if one.code == "exchanged-masks"] == [("exchanged-masks", 6)]


def test_interpolated_holes_are_named():
    from scipy.ndimage import zoom

    depth = np.full((96, 128), 60.0, np.float32)
    depth[20:50, 30:70] = 0
    assert blended_rim(depth) == 0 and np.isnan(blended_rim(depth * 0 + 60))
    soft = np.maximum(zoom(depth, 2, order=1), 0).astype(np.float32)
    assert blended_rim(soft) > 0.5
    assert rim_finding([blended_rim(depth), float("nan")], "depth") == []
    (found,) = rim_finding([blended_rim(soft)], "depth")
    assert found.code == "blended-depth"


def evidence(pictures, masks):
    found = MaskEvidence()
    for picture, mask in zip(pictures, masks):
        found.add(picture, mask, None)
    return [one.what for one in found.flip_findings("masks")]


def test_mirrored_masks_are_named():
    picture = np.full((96, 128, 3), (170, 80, 70), np.uint8)
    tissue = np.ones((96, 128), bool)
    picture[:50, :40], tissue[:50, :40] = 120, False
    assert evidence([picture], [tissue]) == []
    (what,) = evidence([picture], [tissue[:, ::-1]])
    assert what.endswith("with masks that are mirrored")
    (what,) = evidence([picture], [tissue[::-1]])
    assert what.endswith("with masks that are upside down")


def test_mirrored_masks_of_a_recorded_clip():
    pictures = recorded(count=4)
    masks = [plane == 0 for plane in recorded(part="gt_masks", count=4)]
    masks = [mask if mask.ndim == 2 else mask.all(axis=2) for mask in masks]
    assert evidence(pictures, masks) == []
    assert len(evidence(pictures, [mask[:, ::-1] for mask in masks])) == 1


def test_coefficients_in_the_order_of_other_programs_are_named():
    right = np.array([-0.31, 0.12, 0.0007, -0.0003, -0.08])
    assert lens_warnings(MATRIX, right, 320, 256) == []
    (warning,) = lens_warnings(MATRIX, np.array([-0.31, 0.12, -0.08, 0.0007, -0.0003]), 320, 256)
    assert "-0.31 0.12 0.0007 -0.0003 -0.08 if they are k1 k2 k3 p1 p2" in warning
    assert "tangential coefficients of 0.2" in lens_warnings(MATRIX, np.array([-0.3, 0.1, 0.0, 0.2]), 320, 256)[0]


def test_black_bars_do_not_make_two_views():
    rng = np.random.default_rng(0)
    grey = []
    for _ in range(4):
        picture = np.zeros((40, 80))
        picture[:, 20:60] = rng.uniform(60, 200, (40, 40))
        grey.append(picture)
    assert halves_finding(grey, "clip") == []
    pairs = [np.vstack([half, half]) for half in (picture[:20] for picture in grey)]
    assert "stacked" in halves_finding(pairs, "clip")[0].what


@pytest.mark.parametrize("name", ["a.dcm", "IM0001"])
def test_a_dicom_file_is_named_as_one(name, tmp_path):
    (tmp_path / "study").mkdir()
    for file in (tmp_path / name, tmp_path / "study" / name):
        file.write_bytes(b"\0" * 128 + b"DICM" + b"\0" * 64)
    with pytest.raises(InputError, match="a DICOM file; export it as a video or as PNG pictures"):
        layout_of(tmp_path / name)
    with pytest.raises(InputError, match="it holds 1 DICOM file; export it"):
        layout_of(tmp_path / "study")


@pytest.mark.parametrize(("name", "said"), [("a.npz", "frames in arrays are not read; write each as a png picture"),
                                            ("a.exr", "1 files that end in .exr; convert them to png"),
                                            ("a.zip", "1 archive of the ending .zip; unpack first")])  # fmt: skip
def test_arrays_and_archives_are_named_as_such(name, said, tmp_path):
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / name).write_bytes(b"data")
    with pytest.raises(InputError, match=said):
        layout_of(tmp_path / "frames")
    if name == "a.npz":
        with pytest.raises(InputError, match=said):
            layout_of(tmp_path / "frames" / name)
