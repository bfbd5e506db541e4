"""Files of another program reach the frames that they belong to, or are refused with the option that selects a way."""

import contextlib
import io
import tomllib
from pathlib import Path

import numpy as np
import pytest
from depth_folders import true_depth
from input_kinds import of_all_frames

from endotsr.cli.main import main
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.opencv.png import write_png
from endotsr.clips.sequences.pairing import paired
from endotsr.errors import InputError

WIDTH, HEIGHT = 64, 48
TRUE = {"masks": lambda k: 2 + k, "depth": lambda k: 4000 + 10 * k}


def numbered(folder: Path, what: str, numbers, frames=None) -> str:
    """Files with these numbers whose pixels say the frame that they belong to (by default, in order)."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    for number, k in zip(numbers, frames or range(len(numbers))):
        plane = rng.integers(40, 200, (HEIGHT, WIDTH, 3), np.uint8)
        if what == "masks":
            plane = np.zeros((HEIGHT, WIDTH), np.uint8)
            plane[:, : TRUE["masks"](k)] = 255
        elif what == "depth":
            plane = np.full((HEIGHT, WIDTH), TRUE["depth"](k), np.uint16)
            plane[::2] += 300
        write_png(folder / f"{number:06d}.png", plane)
    return str(folder)


def run(*words: object) -> tuple[int, str]:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        return main([str(word) for word in words]), said.getvalue()


def prepared(source: object, out: Path, *words: object) -> tuple[int, str]:
    return run("prepare", source, "--out", out, *words)


def frames_of_masks(clip: Path) -> list[int]:
    """The frame that each mask says it belongs to."""
    return [int((read_picture(file)[0] > 0).sum()) - 2 for file in sorted((clip / "masks").iterdir())]


def frames_of_depth(clip: Path) -> list[int]:
    scale = tomllib.loads((clip / "sequence.toml").read_text())["depth"]["scale"]
    return [round((read_picture(f)[1, 0] * scale - 40) / 0.1) for f in sorted((clip / "depth").iterdir())]


CAMERA = ("--camera", "60", "60", "32", "24")
TAKEN = list(range(10, 60, 2))


@pytest.fixture
def recording(tmp_path):
    return numbered(tmp_path / "recording", "pictures", range(60))


@pytest.fixture
def clip(recording, tmp_path):
    """Every second picture from 10 on, prepared: written as 0 to 24."""
    code, said = prepared(recording, tmp_path / "clip", *CAMERA, "--frames", "10:60:2")
    assert code == 0, said
    return tmp_path / "clip"


def test_prepare_keeps_the_names_of_the_source_over_two_steps(clip, tmp_path):
    names = tomllib.loads((clip / "sequence.toml").read_text())["source_names"]
    assert names == [f"{k:06d}" for k in TAKEN]
    prepared(clip, tmp_path / "again", "--frames", "::5")
    assert tomllib.loads((tmp_path / "again/sequence.toml").read_text())["source_names"] == names[::5]


def test_names_that_stay_the_same_are_not_written(recording, tmp_path):
    prepared(recording, tmp_path / "out", *CAMERA)
    assert "source_names" not in (tmp_path / "out/sequence.toml").read_text()


@pytest.mark.parametrize("gaps", [(), ("--gaps", "fill"), ("--gaps", "drop")])
@pytest.mark.parametrize(("pictures", "masks"), [(range(12), range(1, 13)), (range(1, 13), range(12))])
def test_masks_counted_from_another_number_are_refused_until_a_way_is_stated(pictures, masks, gaps, tmp_path):
    source, files = numbered(tmp_path / "p", "pictures", pictures), numbered(tmp_path / "m", "masks", masks)
    code, said = prepared(source, tmp_path / "out", *CAMERA, "--masks", files, *gaps)
    assert code == 2 and "1 of 12 files no frame" in said and "--pairing order" in said
    code, said = prepared(source, tmp_path / "out", *CAMERA, "--masks", files, "--pairing", "order")
    assert code == 0 and "--pairing order" in said and frames_of_masks(tmp_path / "out") == list(range(12))


@pytest.mark.parametrize("words", [("--masks",), ("--unite-masks",)])
def test_masks_with_the_numbers_of_the_source_reach_a_prepared_clip(words, clip, tmp_path):
    files = numbered(tmp_path / "m", "masks", TAKEN, TAKEN)
    code, said = prepared(clip, tmp_path / "out", *words, files)
    assert code == 0 and "m: paired by the number of each frame in the recording" in said
    assert frames_of_masks(tmp_path / "out") == TAKEN


def test_masks_of_the_whole_recording_are_refused_until_a_way_is_stated(clip, tmp_path):
    files = numbered(tmp_path / "m", "masks", range(60))
    code, said = prepared(clip, tmp_path / "out", "--masks", files)
    assert code == 2 and "two ways that differ" in said
    for way, frames in (("source", TAKEN), ("number", list(range(25)))):
        code, said = prepared(clip, tmp_path / way, "--masks", files, "--pairing", way)
        assert code == 0 and "belonging to no frame, not used" in said and frames_of_masks(tmp_path / way) == frames


def test_depth_of_another_program_pairs_by_the_numbers_of_the_source(clip, tmp_path):
    files = numbered(tmp_path / "d", "depth", TAKEN, TAKEN)
    code, said = prepared(clip, tmp_path / "out", "--depth", files, "--depth-scale", "0.01")
    assert code == 0, said
    assert frames_of_depth(tmp_path / "out") == TAKEN
    code, said = run("depth", clip, "--given", files, "--kind", "depth", "--unit-scale", "0.01")
    assert code == 0 and "paired by the number of each frame in the recording" in said
    assert frames_of_depth(clip) == TAKEN


def test_one_depth_file_less_or_more_is_named(tmp_path):
    source = numbered(tmp_path / "p", "pictures", range(12))
    for name, numbers, expected, code_expected in (
        ("less", range(11), "frames without any depth: 11", 0),
        ("more", range(13), "belonging to no frame, not used: 000012.png", 0),
        ("shifted", range(1, 14), "1 of 12 frames have no file and 2 of 13 files no frame", 2),
    ):
        files = numbered(tmp_path / name, "depth", numbers)
        words = ("--depth", files, "--depth-scale", "0.01", "--trust-depth")
        code, said = prepared(source, tmp_path / f"out_{name}", *CAMERA, *words)
        assert code == code_expected and expected in said


def test_stamps_of_a_trajectory_are_the_numbers_in_the_names(tmp_path):
    source = numbered(tmp_path / "p", "pictures", range(1, 13))
    path = tmp_path / "poses.txt"
    for stamps, frames in ((range(1, 12), range(11)), ((2, 5, 12), (1, 4, 11)), (range(30), range(12))):
        path.write_text("".join(f"{k} {0.001 * k} 0 0 0 0 0 1\n" for k in stamps))
        words = ("--trajectory", path, "--gaps", "drop", "--replace")
        code, said = prepared(source, tmp_path / "out", *CAMERA, *words)
        assert code == 0 and "numbers in the names" in said, said
        matrices = tomllib.loads((tmp_path / "out/sequence.toml").read_text())["poses"]["matrices"]
        assert [round(-row[3]) for row in matrices] == [k + 1 for k in frames]


def test_a_way_that_cannot_be_is_refused(tmp_path):
    files = [tmp_path / f"{k}.png" for k in range(5)]
    with pytest.raises(InputError, match="5 files for 6 frames"):
        paired(6, files, "order")
    with pytest.raises(InputError, match="not those of a prepared clip"):
        paired(5, files, "source")
    with pytest.raises(InputError, match=r"no file has a number from 0 to 4.*--pairing order"):
        paired(5, [tmp_path / f"{100 + k}.png" for k in range(5)])


def test_source_names_are_checked(clip):
    from endotsr.clips.sequences.sequence_file import read_sequence_file

    file = clip / "sequence.toml"
    text = file.read_text()
    for old, new, said in (('"000010"', '"000012"', "two frames have one name"), ('"000010", ', "", "24 names for 25"),
                           ('"000010"', '"../a"', "source_names")):  # fmt: skip
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=said):
            read_sequence_file(clip)


def test_a_single_file_is_said_to_be_that_of_all_frames(tmp_path):
    """It may be the only frame that was finished."""
    source = numbered(tmp_path / "raw", "pictures", range(4))
    given = numbered(tmp_path / "masks", "masks", [2], frames=[2])
    code, said = prepared(source, tmp_path / "o", *CAMERA, "--masks", given)
    assert code == 0 and "000002.png: taken for all 4 frames" in said


@pytest.mark.parametrize(("name", "said"), [("{}.png", True), ("{:02}.png", False), ("frame-{:04}.color.png", False)])
def test_names_that_sort_otherwise_as_text_are_named_for_an_array(name, said, tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((12, 8, 8)))
    planes = [tmp_path / f"a.npy/{k:06d}" for k in range(12)]
    found = paired([Path("clip") / name.format(k) for k in range(12)], planes)
    assert ("10.png stands in the place of 2.png" in found.note) == said


def test_an_array_of_names_with_zeros_needs_no_caution(tmp_path, capsys):
    words = of_all_frames(lambda k: true_depth(k).astype(np.float32), "--depth", lambda k: f"{k:02d}.png")(tmp_path)
    assert main(words) == 0
    assert "leading zeros" not in capsys.readouterr().out
