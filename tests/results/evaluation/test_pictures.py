"""Pictures of any method, paired with the frames and measured as the baselines are."""

import dataclasses

import numpy as np
import pytest

from endotsr.clips.formats.film_file import write_video
from endotsr.clips.opencv.png import write_png
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.errors import InputError
from endotsr.results.evaluation import pictures
from endotsr.results.evaluation.baselines import BASELINES, flow_interpolation
from endotsr.results.evaluation.metrics import round_8bit
from endotsr.results.evaluation.pictures import find_renders, measure_pictures, read_render

HELD_OUT = [1, 9]


@pytest.fixture(scope="module")
def sequence():
    found = simulate(SimulatorSettings(width=48, height=32, frames=12)).sequence
    assert list(found.test_index) == HELD_OUT
    return found


def bytes_of(picture):
    """(3, H, W) in display units as the pixels of an 8-bit file."""
    return (round_8bit(picture) * 255 + 0.5).astype(np.uint8).transpose(1, 2, 0)


def write_folder(folder, names):
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(names):
        if name.endswith(".npy"):
            np.save(folder / name, np.full((3, 32, 48), k / 10, np.float32))
        else:
            write_png(folder / name, np.full((32, 48, 3), k, np.uint8))
    return folder


@pytest.mark.parametrize("baseline", BASELINES)
def test_float_pictures_of_a_baseline_equal_its_row_to_the_last_digit(baseline, sequence, tmp_path):
    make = BASELINES[baseline][1](sequence)
    for i in HELD_OUT:
        np.save(tmp_path / f"{sequence.names[i]}.npy", make(i))
    found = measure_pictures(find_renders(tmp_path, sequence), sequence)
    row = found["baselines"][baseline]
    assert found["held_out"] == {key: row[key] for key in found["held_out"]}


def test_8bit_pictures_of_the_flow_equal_the_8bit_columns_of_its_row(sequence, tmp_path):
    for i in HELD_OUT:
        write_png(tmp_path / f"{sequence.names[i]}.png", bytes_of(flow_interpolation(sequence, i)))
    found = measure_pictures(find_renders(tmp_path, sequence), sequence)
    rows = zip(found["held_out"]["per_frame"], found["baselines"]["flow_interpolation"]["per_frame"])
    for ours, row in rows:
        for key in ("psnr_full_8bit", "psnr_tissue_8bit", "ssim_full_8bit", "ssim_tissue_8bit"):
            assert ours[key] == row[key]
        assert ours["psnr_full"] == pytest.approx(row["psnr_full_8bit"], abs=1e-4)


@pytest.mark.parametrize("frames", [HELD_OUT, list(range(12))])
def test_a_video_of_renders_is_measured(frames, sequence, tmp_path):
    """Without loss in the file, the numbers are those of the same pictures as PNG."""
    shown = {i: bytes_of(flow_interpolation(sequence, i) if i in HELD_OUT else sequence.frame(i).image) for i in frames}
    write_video(tmp_path / "a.mp4", shown.values(), 25.0, lossless=True)
    (tmp_path / "png").mkdir()
    for i, picture in shown.items():
        write_png(tmp_path / "png" / f"{sequence.names[i]}.png", picture)
    video, folder = (measure_pictures(find_renders(tmp_path / name, sequence), sequence) for name in ("a.mp4", "png"))
    assert video["held_out"] == folder["held_out"] and video["training"] == folder["training"]
    assert "as many pictures as " + ("frames" if len(frames) == 12 else "held-out") in video["pictures"]["pairing"]


def test_a_video_of_other_frames_is_refused(sequence, tmp_path):
    write_video(tmp_path / "a.mp4", [np.zeros((32, 48, 3), np.uint8)] * 3, 25.0, lossless=True)
    with pytest.raises(InputError, match=r"a video of 3 pictures; use one for each of the 12 frames or of the 2 held"):
        find_renders(tmp_path / "a.mp4", sequence)
    write_video(tmp_path / "b.mp4", [np.zeros((16, 48, 3), np.uint8)] * 2, 25.0, lossless=True)
    with pytest.raises(InputError, match=r"a picture of 48x16; use a picture of 48x32"):
        measure_pictures(find_renders(tmp_path / "b.mp4", sequence), sequence)


@pytest.mark.parametrize(
    ("names", "first", "second", "words"),
    [
        (["simulated-000001.png", "simulated-000009.png", "other.png"],
         "simulated-000001.png", "simulated-000009.png", "names"),
        (["simulated-000009.render.png", "simulated-000001.render.png"],
         "simulated-000001.render.png", "simulated-000009.render.png", "names"),
        (["r_9.png", "r_1.png", "r_2.png"], "r_1.png", "r_9.png", "frame numbers"),
        (["00000.png", "00001.png"], "00000.png", "00001.png", "as many files as held-out frames"),
        ([f"{i:03d}.png" for i in range(12)], "001.png", "009.png", "frame numbers"),
        ([f"{i:03d}.png" for i in range(1, 13)], "002.png", "010.png", "as many files as frames"),
        ([f"{10 * i}.png" for i in range(1, 13)], "20.png", "100.png", "as many files as frames"),
        (["a10.npy", "a9.npy", "a3.png"], "a9.npy", "a10.npy", "as many files as held-out frames"),
    ],
)  # fmt: skip
def test_files_are_paired_with_frames(names, first, second, words, sequence, tmp_path):
    found = find_renders(write_folder(tmp_path, names), sequence)
    assert [found.files[i].name for i in HELD_OUT] == [first, second] and words in found.pairing


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (None, "folder of pictures, or video, not found"),
        ([], "contains no picture; use one file per frame, .npy, .png, .tif, .tiff, .bmp"),
        (["a.png", "b.png"], "cannot be paired"),
        (["1.png", "2.png", "3.png"], "3 .png files cannot be paired with the 2 held-out frames (simulated-000001, "),
    ],
)
def test_folders_that_cannot_be_paired_are_refused(names, said, sequence, tmp_path):
    folder = tmp_path / "none" if names is None else write_folder(tmp_path, names)
    with pytest.raises(InputError) as refused:
        find_renders(folder, sequence)
    assert said in str(refused.value) and str(folder) in str(refused.value)


@pytest.mark.parametrize(
    ("array", "said"),
    [
        (np.zeros((3, 32, 47), np.float32), "a picture of 47x32; use a picture of 48x32"),
        (np.zeros((32, 48, 3), np.uint8), "uint8; use an array of float32 or float64"),
        (np.full((3, 32, 48), 128.0), "128; use display units, from 0 to 1"),
        (np.full((3, 32, 48), np.nan), "not finite"),
        (np.linspace(-1, 1, 3 * 32 * 48).reshape(3, 32, 48), "value -1; use display units, from 0 to 1"),
        (b"not an array", "not a plain NumPy array file"),
    ],
)
def test_arrays_that_are_no_pictures_are_refused(array, said, tmp_path):
    file = tmp_path / "0.npy"
    file.write_bytes(array) if isinstance(array, bytes) else np.save(file, array)
    with pytest.raises(InputError) as refused:
        read_render(file, (3, 32, 48))
    assert said in str(refused.value) and "0.npy" in str(refused.value)


def test_planes_last_and_16_bits_are_the_same_picture(tmp_path):
    levels = np.random.default_rng(0).integers(0, 256, (32, 48, 3))
    write_png(tmp_path / "a.png", levels.astype(np.uint8))
    write_png(tmp_path / "b.png", (levels * 257).astype(np.uint16))
    np.save(tmp_path / "c.npy", levels / 255)
    a, b, c = (read_render(tmp_path / name, (3, 32, 48)) for name in ("a.png", "b.png", "c.npy"))
    assert np.array_equal(a, b) and np.abs(a - c).max() < 1e-7 and c.dtype == np.float64


def test_levels_of_8_bits_stored_in_16_are_refused(tmp_path):
    write_png(tmp_path / "a.png", np.full((32, 48, 3), 200, np.uint16))
    with pytest.raises(InputError, match=r"a\.png: 16 bits whose largest value is 200: levels of 8 bits"):
        read_render(tmp_path / "a.png", (3, 32, 48))
    write_png(tmp_path / "b.png", np.zeros((32, 48, 3), np.uint16))
    assert not read_render(tmp_path / "b.png", (3, 32, 48)).any()


def test_training_frames_are_measured_where_the_folder_holds_them(sequence, tmp_path):
    for i in range(sequence.count):
        write_png(tmp_path / f"{sequence.names[i]}.png", np.full((32, 48, 3), 90, np.uint8))
    found = measure_pictures(find_renders(tmp_path, sequence), sequence, "grey")
    assert [row["frame"] for row in found["training"]["per_frame"]] == list(sequence.train_index)
    assert found["label"] == "grey" and found["pictures"]["files"]["simulated-000003"] == "simulated-000003.png"
    fewer = dataclasses.replace(sequence, test_index=np.array([9]), train_index=np.arange(9))
    assert find_renders(tmp_path, fewer).files.keys() == set(range(12))


def test_a_part_of_a_name_that_two_frames_share_pairs_no_file(sequence, tmp_path):
    """Names of seconds: a file of the held-out frame is not that of a training frame of the same second."""
    names = [f"{1305031102 + i // 4}.{25 * (i % 4):02d}" for i in range(12)]
    timed = dataclasses.replace(sequence, names=names)
    found = find_renders(write_folder(tmp_path, [f"{names[i]}.png" for i in HELD_OUT]), timed)
    assert {i: file.stem for i, file in found.files.items()} == {i: names[i] for i in HELD_OUT}


def test_a_doubt_on_pictures_is_in_the_record_and_each_picture_is_read_once(sequence, tmp_path, monkeypatch):
    for i in HELD_OUT:
        write_png(tmp_path / f"{sequence.names[i]}.png", bytes_of(flow_interpolation(sequence, i)[::-1]))
    read, seen = pictures.read_render, []
    monkeypatch.setattr(pictures, "read_render", lambda file, shape: seen.append(file.name) or read(file, shape))
    found = measure_pictures(find_renders(tmp_path, sequence), sequence)
    assert "with red and blue exchanged" in found["pictures"]["doubt"]
    assert sorted(seen) == sorted(f"{sequence.names[i]}.png" for i in HELD_OUT)
