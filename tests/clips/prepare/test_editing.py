"""Editing a clip: frames by number and second, frames left out, a crop, masks united, a folder replaced."""

import shutil
import tracemalloc
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from common_folder import FRAMES, HEIGHT, WIDTH, moving, written
from made_videos import CAMERA, UNEVEN, files, picture, pictures, write

from endotsr.cli.main import main
from endotsr.clips.formats.camera import Intrinsics, StereoCalibration
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.prepare.editing import (
    chosen_frames,
    cropped,
    masks_by_time,
    paired_by_time,
    thinned,
    with_partner,
    without,
)
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.clip import Clip, Depth, Masks, PicturePair
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import FILE_NAME, PoseEntry, read_sequence_file, write_sequence_file
from endotsr.config import PAPER
from endotsr.errors import InputError
from synthetic_folder import write_synthetic_folder


def recording(count=20, **known):
    """A recording of pictures whose pixels tell where they are."""
    y, x = np.mgrid[:24, :32]

    def pictures(wanted):
        for i in wanted:
            shown = np.stack([x, y, np.full_like(x, i)], 2).astype(np.uint8)
            yield PicturePair(shown, shown + np.uint8(100) if known.get("calibration") else None)

    return Clip("test", __file__, [str(i) for i in range(count)], pictures, **known)  # type: ignore[arg-type]


@pytest.mark.parametrize(("text", "frames"), [
    ("", range(20)), ("3:6", [3, 4, 5]), ("0:3,10", [0, 1, 2, 10]), ("10,0:3", [0, 1, 2, 10]), ("0:4,2:6", range(6)),
    ("::5", [0, 5, 10, 15]), ("-2:", [18, 19]), ("-1", [19]), ("1s:1.5s", range(10, 15)), ("1.8s:", [18, 19]),
    (":0.2s,5", [0, 1, 5]), (" 1 , 3 : 5 ", [1, 3, 4]),
])  # fmt: skip
def test_frames_by_number_and_by_second(text, frames):
    assert chosen_frames(text, recording(rate=10.0)) == list(frames)


@pytest.mark.parametrize(("text", "said"), [
    ("3:3", "selects nothing"), ("20", "outside"), ("0:21", "outside"), ("a", "not a range"), (",", "not a range"),
    ("1s", "no span of seconds"), ("1:2s", "no span of seconds"), ("1s:9s", "ends after 1.900"), ("1:2:0", "the step"),
    ("1:2:3:4", "not a range.*several with commas"), ("5s:", "selects nothing"),
    ("-1s:", "seconds count from the first frame"), ("0s:-0.5s", "seconds count from the first frame"),
])  # fmt: skip
def test_what_is_no_frame_is_refused(text, said):
    with pytest.raises(InputError, match=said):
        chosen_frames(text if text != "," else ":,x", recording(rate=10.0))


def test_seconds_need_a_rate_and_follow_time_stamps():
    with pytest.raises(InputError, match="the frame rate is unknown"):
        chosen_frames("0s:1s", recording())
    stamps = np.cumsum(np.linspace(0.05, 0.3, 20))
    found = chosen_frames("1s:2s", recording(rate=5.0, times=stamps))
    assert found == [i for i in range(20) if 1 <= stamps[i] - stamps[0] < 2]


def test_a_prepared_folder_is_told_where_its_rate_is_stated(tmp_path, capsys):
    written(tmp_path / "clip")
    for words in (["--rate", "5"], ["--frames", "0s:1s"]):
        assert main(["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), *words]) == 2
        said = capsys.readouterr().err
        assert "frame_rate in" in said and FILE_NAME in said and "--source-rate" not in said


def test_separate_pairs_have_no_rate_to_state():
    with pytest.raises(InputError, match="frame rate is unknown; use a recording") as refused:
        thinned(replace(recording(), layout="servct"), [0, 1, 2], 5.0, [])
    assert "--source-rate" not in str(refused.value)


def test_an_endonerf_folder_takes_the_rate_that_its_refusal_names(tmp_path, capsys):
    write_synthetic_folder(tmp_path / "clip", frames=8)
    out, base = tmp_path / "o", ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o")]
    assert main([*base, "--rate", "5"]) == 2 and "use --source-rate" in capsys.readouterr().err
    for words, rate in ((["--rate", "5"], 5), (["--frames", "0.1s:0.5s"], 10)):
        shutil.rmtree(out, ignore_errors=True)
        assert main([*base, "--source-rate", "10", *words]) == 0
        found = read_sequence_file(out)
        assert (found.frames, found.frame_rate) == (4, rate)


def test_frames_are_left_out():
    assert without([2, 3, 4, 5], "3,5:7", recording()) == [2, 4]
    assert without([2, 3], "", recording()) == [2, 3]


def test_a_crop_moves_the_principal_point_of_every_camera():
    intrinsics = Intrinsics(30.0, 31.0, 16.0, 12.0, 32, 24)
    calibration = StereoCalibration(intrinsics, intrinsics._replace(cx=15.0), np.eye(3), np.array([-4.0, 0, 0]))
    found = cropped(recording(intrinsics=intrinsics, calibration=calibration,
                              depth=Depth(lambda i: np.arange(768, dtype=np.float32).reshape(24, 32)),
                              masks=Masks(lambda i: None if i else np.ones((24, 32), bool))),
                    (5, 3, 20, 12))  # fmt: skip
    assert found.intrinsics == Intrinsics(30.0, 31.0, 11.0, 9.0, 20, 12) and found.calibration.right.cx == 10.0
    pair = next(found.pictures([7]))
    assert pair.left[0, 0].tolist() == [5, 3, 7] and pair.left[-1, -1].tolist() == [24, 14, 7]
    assert pair.right[0, 0].tolist() == [105, 103, 107]
    assert found.depth(0)[0, 0] == 3 * 32 + 5 and found.masks(0).shape == (12, 20) and found.masks(1) is None


@pytest.mark.parametrize("window", [(0, 0, 33, 4), (30, 0, 4, 4), (-1, 0, 4, 4), (0, 0, 0, 4), (0, 0, 4)])
def test_a_crop_outside_is_refused(window):
    with pytest.raises(InputError, match="--crop"):
        next(cropped(recording(), window).pictures([0]))


@pytest.mark.parametrize("other", ["depth", "pictures", "camera"])
def test_a_crop_needs_one_size(other):
    camera = Intrinsics(30.0, 31.0, 16.0, 12.0, *((64, 48) if other == "camera" else (32, 24)))
    depth = Depth(lambda i: np.ones((48, 64), np.float32))
    clip = cropped(recording(intrinsics=camera, depth=depth), (5, 3, 20, 12))
    if other == "pictures":
        odd = replace(
            recording(), pictures=lambda wanted: (PicturePair(np.zeros((48, 64, 3), np.uint8)) for _ in wanted)
        )
        clip = cropped(replace(odd, intrinsics=camera), (5, 3, 20, 12))
    what, size = ("depth", "64x48") if other == "depth" else ("pictures", "64x48" if other == "pictures" else "32x24")
    with pytest.raises(InputError, match=f"frame 7: {what} of {size} pixels, the camera is of"):
        clip.depth(7) if other == "depth" else next(clip.pictures([7]))


def test_seconds_and_dropped_frames_of_a_video(tmp_path, capsys):
    write(tmp_path / "a.mkv", pictures(), milliseconds=UNEVEN)
    words = ["prepare", str(tmp_path / "a.mkv"), "--out", str(tmp_path / "o"), *CAMERA]
    assert main([*words, "--frames", "0:6", "--drop", "2,4"]) == 0
    found = read_sequence_file(tmp_path / "o")
    np.testing.assert_allclose(found.times, np.array([UNEVEN[i] for i in (0, 1, 3, 5)]) / 1000, atol=2e-3)
    for file, i in zip(sorted((tmp_path / "o/images").iterdir()), (0, 1, 3, 5), strict=True):
        assert np.abs(read_png(file).astype(int) - picture(i)).mean() < 10
    assert main([*words, "--drop", "0:12"]) == 2 and "exists already" in capsys.readouterr().err
    assert main([*words, "--drop", "0:12", "--replace"]) == 2 and "no frame is left" in capsys.readouterr().err
    assert read_sequence_file(tmp_path / "o") == found  # after an error the old folder is there


def test_what_prepare_did_not_write_is_never_lost(tmp_path, capsys):
    written(tmp_path / "raw")
    words = ["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "clip")]
    assert main(words) == 0
    (tmp_path / "raw").rename(tmp_path / "clip/raw")
    (tmp_path / "clip/notes.txt").write_text("mine")
    inside = ["prepare", str(tmp_path / "clip/raw"), "--out", str(tmp_path / "clip"), "--replace"]
    assert main(inside) == 2
    assert "is not replaced: it also holds notes.txt, raw, which would be lost" in capsys.readouterr().err
    assert (tmp_path / "clip/raw/sequence.toml").is_file() and (tmp_path / "clip/notes.txt").read_text() == "mine"


def test_neither_folder_is_inside_the_other(tmp_path, capsys):
    written(tmp_path / "raw")
    clip, inside = tmp_path / "clip", tmp_path / "raw/clip"
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(inside)]) == 2
    assert f"{inside}: is inside the source {tmp_path / 'raw'}; choose an --out outside" in capsys.readouterr().err
    assert not inside.exists() and main(["prepare", str(tmp_path / "raw"), "--out", str(clip)]) == 0
    words = ["prepare", str(clip / "images"), "--out", str(clip), "--replace", "--camera", "60", "60", "16", "12"]
    assert main(words) == 2
    said = f"is inside {clip}, which would be replaced; choose another --out, or the source {clip}"
    assert said in capsys.readouterr().err and (clip / "depth").is_dir()


def test_an_empty_folder_is_replaced_as_it_is_used_without_replace(tmp_path):
    written(tmp_path / "raw")
    (tmp_path / "clip").mkdir()
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "clip"), "--replace"]) == 0


def test_filled_poses_follow_the_times_and_are_recorded(tmp_path):
    """Without a pose, frame 2 is at three quarters of the way from frame 1 to frame 3."""
    found = written(tmp_path / "clip", poses=moving(), times=[0.0, 1.0, 2.5, 3.0, 4.0])
    rows = [[float(i)] * 12 if i == 2 else row for i, row in enumerate(found.poses.matrices)]  # no rotation
    gap = msgspec.structs.replace(found, poses=PoseEntry(matrices=rows, origin="a tracker", interpolated=[4]))
    write_sequence_file(gap, tmp_path / "clip")
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), "--gaps", "fill", "--frames", "1:5"]
    assert main(words) == 0
    poses = read_sequence_file(tmp_path / "o").poses
    assert poses.origin == "a tracker" and poses.interpolated == [1, 3]
    first, between, last = (row[3] for row in poses.matrices[:3])
    assert between == pytest.approx(first + 0.75 * (last - first))


def test_masks_are_united(tmp_path, capsys):
    written(tmp_path / "clip")
    border = np.zeros((HEIGHT, WIDTH), np.uint8)
    border[-3:] = 255
    write_png(tmp_path / "border.png", border)
    logos = np.zeros((FRAMES, HEIGHT, WIDTH), np.uint8)
    for i in range(FRAMES):
        logos[i, 15, i] = 255
    files(tmp_path, "logo", logos)
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), "--unite-masks"]
    assert main([*words, str(tmp_path / "border.png"), str(tmp_path / "logo")]) == 0
    before, after = describe(tmp_path / "clip"), describe(tmp_path / "o")
    for i in range(FRAMES):
        expected = before.masks(i).copy()
        expected[-3:] = expected[15, i] = False
        assert (after.masks(i) == expected).all()
    assert "masks: united with border.png, logo" in capsys.readouterr().out


def test_a_folder_is_replaced_by_an_edit_of_itself_and_nothing_else_is(tmp_path, capsys):
    written(tmp_path / "clip", poses=moving())
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "clip"), "--replace", "--drop", "1"]
    assert main(words) == 0
    assert read_sequence_file(tmp_path / "clip").frames == FRAMES - 1
    assert [file.name for file in tmp_path.iterdir()] == ["clip"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/letter.txt").write_text("dear")
    words[3] = str(tmp_path / "mine")
    assert main(words) == 2 and "holds no sequence.toml" in capsys.readouterr().err
    assert (tmp_path / "mine/letter.txt").exists()


def test_what_a_replaced_folder_loses_is_noted(tmp_path, capsys):
    written(tmp_path / "clip", poses=moving())
    shutil.copytree(tmp_path / "clip/images", tmp_path / "raw")
    edit = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "clip"), "--replace"]
    assert main(edit) == 0 and "the replaced folder had" not in capsys.readouterr().out
    camera = ["--camera", "60", "60", "16", "12"]
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "clip"), "--replace", *camera]) == 0
    said = capsys.readouterr().out
    for what in ("masks", "depth", "poses"):
        assert f"the replaced folder had {what} (" in said and f"`endotsr {what}` makes new ones" in said


def broken(clip, what):
    """A fault in frame 3."""
    if what == "pose":
        text = (clip / FILE_NAME).read_text().replace("-6.0", "nan")
        assert "nan" in text
        (clip / FILE_NAME).write_text(text)
    else:
        file = clip / what / "000003.png"
        file.write_bytes(file.read_bytes()[:100])


@pytest.mark.parametrize("what", ["images", "masks", "depth", "pose"])
def test_a_fault_in_one_frame_is_mended_by_dropping_it_as_check_says(what, tmp_path):
    written(tmp_path / "clip", poses=moving())
    broken(tmp_path / "clip", what)
    with pytest.raises(InputError):
        read_sequence(tmp_path / "clip", PAPER.sequence, 0.2)
    found = [f for f in check_sequence(tmp_path / "clip", PAPER).findings if f.level == "refusal"]
    assert found and all("--replace --drop FRAME" in f.remedy for f in found)
    clip = str(tmp_path / "clip")
    assert main(["prepare", clip, "--out", clip, "--replace", "--drop", "3"]) == 0
    assert len(read_sequence(tmp_path / "clip", PAPER.sequence, 0.2).images) == FRAMES - 1


def test_what_is_assumed_of_the_depth_survives_an_edit(tmp_path):
    written(tmp_path / "clip", depth=False)
    clip = str(tmp_path / "clip")
    file = tmp_path / "clip" / FILE_NAME
    file.write_text(file.read_text().replace("baseline = 4.0", "baseline = 0.0"))
    assert main(["depth", clip, "--flat"]) == 0
    assert main(["prepare", clip, "--out", clip, "--replace", "--drop", "0"]) == 0
    entry = read_sequence_file(tmp_path / "clip").depth
    assert entry.assumed == "shape" and entry.method.startswith("assumed: a plane")


def test_frames_of_a_lower_rate_are_the_nearest_without_a_table_of_all_pairs():
    rng, notes = np.random.default_rng(0), []
    for count in (1, 2, 3, 40):
        times = np.cumsum(rng.uniform(0.01, 0.2, count))
        wanted = times[0] + np.arange(int((times[-1] - times[0]) * 4.0 + 1e-6) + 1) / 4.0
        table = np.abs(times[None, :] - wanted[:, None] + 1e-9).argmin(axis=1)
        found = thinned(recording(count, rate=10.0, times=times), list(range(count)), 4.0, notes)
        assert found == np.unique(table).tolist()
    tracemalloc.start()
    try:
        assert len(thinned(recording(8000, rate=30.0), list(range(8000)), 15.0, notes)) == 4000
        assert tracemalloc.get_traced_memory()[1] < 10e6  # bytes; the table has 256 million
    finally:
        tracemalloc.stop()


def stereo(count=20):
    """A recording whose pixels are the frame number in the left view and 100 more in the right one."""
    read = []

    def pictures(wanted):
        assert wanted == sorted(set(wanted))
        for i in wanted:
            read.append(i)
            yield PicturePair(np.full((2, 2, 3), i, np.uint8), np.full((2, 2, 3), 100 + i, np.uint8))

    return Clip("test", Path("clip"), [str(i) for i in range(count)], pictures), read


@pytest.mark.parametrize("late", [1, -1, 3, -4, 19])
@pytest.mark.parametrize("wanted", [range(20), range(2, 20, 5), [0, 1, 7, 8, 19]])
def test_a_right_view_that_lags_is_paired_by_moment(late, wanted):
    """Every picture that is needed is decoded once, in the order of the recording."""
    clip, read = stereo()
    notes: list[str] = []
    kept = with_partner(clip, list(wanted), late, "a right picture", notes)
    assert kept == [i for i in wanted if i + late in range(20)]
    found = [(int(pair.left[0, 0, 0]), int(pair.right[0, 0, 0])) for pair in paired_by_time(clip, late).pictures(kept)]
    assert found == [(i, 100 + i + late) for i in kept]
    assert read == sorted({*kept, *(i + late for i in kept)})
    assert bool(notes) == (len(kept) < len(wanted))


def test_pairs_paired_by_time_keep_no_more_pictures_than_the_lag():
    clip, read = stereo(100)
    for turn, pair in enumerate(paired_by_time(clip, 3).pictures(list(range(97)))):
        assert pair.left[0, 0, 0] == turn and len(read) <= turn + 4


def test_a_lag_needs_right_pictures_and_a_longer_clip():
    with pytest.raises(InputError, match="--right-late 20: use -19 to 19 for 20 frames"):
        paired_by_time(recording(), 20)
    with pytest.raises(InputError, match="no right pictures"):
        next(paired_by_time(recording(), 1).pictures([3]))


@pytest.mark.parametrize("late", [1, -2])
def test_masks_that_lag_are_given_to_the_pictures_of_their_moment(late, tmp_path, capsys):
    written(tmp_path / "clip")
    words = ["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "o"), "--masks-late", str(late)]
    assert main(words) == 0
    kept = [i for i in range(FRAMES) if 0 <= i + late < FRAMES]
    assert len(list((tmp_path / "o" / "masks").iterdir())) == len(kept)
    for k, i in enumerate(kept):
        for part, frame in (("images", i), ("masks", i + late), ("depth", i)):
            made, given = (tmp_path / name / part / f"{n:06d}.png" for name, n in (("o", k), ("clip", frame)))
            np.testing.assert_array_equal(read_png(made) > 0, read_png(given) > 0)
    said = capsys.readouterr().out
    side = "1 frame late" if late > 0 else "2 frames early"
    assert f"masks taken as {side}: frame i has mask i {late:+d}" in said
    assert f"{FRAMES - len(kept)} frame{'s' * (late < 0)} without a mask of their moment omitted" in said


def test_a_lag_of_masks_needs_masks_and_a_longer_clip():
    masks = Masks(lambda i: np.full((2, 2), i % 2 == 0))
    with pytest.raises(InputError, match="--masks-late -20: use -19 to 19 for 20 frames"):
        masks_by_time(recording(masks=masks), -20)
    with pytest.raises(InputError, match="no masks; --masks-late is allowed for a clip with masks alone"):
        masks_by_time(recording(), 1)
