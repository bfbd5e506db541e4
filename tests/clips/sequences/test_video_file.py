"""Videos: what they hold, decoded or refused, and never another picture, time or orientation in silence."""

import os

import av
import numpy as np
import pytest
from made_videos import CAMERA, HEIGHT, INTERLACED, UNEVEN, WIDTH, picture, pictures, turn, woven, write

from endotsr.cli.main import main
from endotsr.clips.opencv import read_png
from endotsr.clips.sequences.layouts import describe
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import read_sequence_file
from endotsr.clips.sequences.video_file import video_facts, video_pictures
from endotsr.errors import InputError

CLOSE = 8.0  # mean grey levels that a codec may cost; a moment later differs by more


def apart(a, b):
    return float(np.abs(a.astype(int) - b.astype(int)).mean())


@pytest.mark.parametrize("kind", INTERLACED)
def test_interlaced_video_is_deinterlaced(kind, tmp_path, capsys):
    name, codec, options = INTERLACED[kind]
    write(tmp_path / name, woven(), codec, options=options)
    assert video_facts(tmp_path / name).interlaced
    assert main(["prepare", str(tmp_path / name), "--out", str(tmp_path / "o"), *CAMERA]) == 0
    assert "is interlaced: deinterlaced" in capsys.readouterr().out
    for i in range(12):
        found = read_png(tmp_path / f"o/images/{i:06d}.png")
        assert apart(found, picture(2 * i)) < CLOSE, "the first field"
        combed = (
            found.astype(int)[2:-1:2] - (found.astype(int)[1:-2:2] + found.astype(int)[3::2][: len(found) // 2 - 1]) / 2
        )
        assert np.abs(combed).mean() < 6, "no rows of another moment between them"


def test_progressive_video_is_not_touched(tmp_path):
    frames = pictures()
    write(tmp_path / "a.mkv", frames, "ffv1", layout="bgr0")
    facts = video_facts(tmp_path / "a.mkv")
    assert (facts.interlaced, facts.turn, facts.count, facts.codec) == (False, 0, 12, "ffv1")
    for found, made in zip(video_pictures(tmp_path / "a.mkv", [0, 3, 11]), (frames[0], frames[3], frames[11])):
        np.testing.assert_array_equal(found, made)


@pytest.mark.parametrize(("name", "codec"), [("a.mkv", "libx264"), ("a.mp4", "libx264"), ("a.webm", "libvpx-vp9")])
def test_uneven_times_become_the_times_of_the_sequence(name, codec, tmp_path, capsys):
    write(tmp_path / name, pictures(), codec, milliseconds=UNEVEN)
    np.testing.assert_allclose(video_facts(tmp_path / name).times, np.array(UNEVEN) / 1000, atol=1e-3)
    assert main(["prepare", str(tmp_path / name), "--out", str(tmp_path / "o"), *CAMERA]) == 0
    assert "not evenly spaced (0.033 to 0.633 s apart)" in capsys.readouterr().out
    stated = read_sequence_file(tmp_path / "o")
    assert stated.times == pytest.approx(np.array(UNEVEN) / 1000, abs=1e-3)
    assert stated.frame_rate == pytest.approx(11 / 1.333, rel=1e-2)
    clip = describe(tmp_path / "o")
    assert clip.times is not None and len(clip.times) == 12


def test_a_training_has_the_times_of_the_file(tmp_path):
    """t = (s - s_0) / (s_last - s_0) (n - 1) / n, of the frames that were selected."""
    from common_folder import written

    from endotsr.config import SequenceConfig

    written(tmp_path, times=[0.0, 0.1, 0.2, 0.9, 1.0])
    sequence = read_sequence(tmp_path, SequenceConfig(), 0.2)
    np.testing.assert_allclose(sequence.times, np.array([0.0, 0.1, 0.2, 0.9, 1.0]) * 4 / 5, rtol=1e-15)
    assert any("uneven-times: the frames are 0.1 to 0.7 s apart" in note for note in sequence.notes)
    part = read_sequence(tmp_path, SequenceConfig(frames="2:5"), 0.2)
    np.testing.assert_allclose(part.times, np.array([0.0, 0.7, 0.8]) / 0.8 * 2 / 3, rtol=1e-14)
    from endotsr.results.evaluation.baselines import neighbours

    assert neighbours(sequence, 1).fraction == pytest.approx(0.5)


def test_a_rate_is_kept_by_the_times(tmp_path, capsys):
    write(tmp_path / "a.mkv", pictures(), milliseconds=UNEVEN)
    words = ["prepare", str(tmp_path / "a.mkv"), "--out", str(tmp_path / "o"), *CAMERA, "--rate", "2"]
    assert main(words) == 0 and "3 of 12 frames kept for 2 a second, by their times" in capsys.readouterr().out
    for k, i in enumerate((0, 4, 7)):  # at 0, 500 and 1200 ms; by number it would have been 0, 4 and 8
        assert apart(read_png(tmp_path / f"o/images/{k:06d}.png"), picture(i)) < CLOSE


def test_frames_that_are_left_out_leave_their_time(tmp_path):
    from raw_sources import stereomis

    stereomis(tmp_path / "raw")
    (tmp_path / "raw/masks/000002l.png").unlink()
    assert main(["prepare", str(tmp_path / "raw"), "--out", str(tmp_path / "o"), "--gaps", "drop"]) == 0
    assert read_sequence_file(tmp_path / "o").times == pytest.approx([0.0, 0.04, 0.12, 0.16, 0.2])


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_stated_rotation_is_not_applied_in_silence(degrees, tmp_path, capsys):
    turn(write(tmp_path / "a.mp4", pictures(4)), degrees)
    words = ["prepare", str(tmp_path / "a.mp4"), *CAMERA, "--out"]
    assert main([*words, str(tmp_path / "no")]) == 2 and not (tmp_path / "no").exists()
    assert "--orientation turned" in capsys.readouterr().err
    for way, quarters in (("stored", 0), ("turned", -degrees // 90)):
        assert main([*words, str(tmp_path / way), "--orientation", way]) == 0
        assert "states a rotation" in capsys.readouterr().out
        shown = np.rot90(picture(0), quarters)
        found = read_sequence_file(tmp_path / way).camera
        assert (found.width, found.height) == (shown.shape[1], shown.shape[0])
        assert apart(read_png(tmp_path / way / "images/000000.png"), shown) < CLOSE


def test_a_video_that_shows_nothing_is_refused_by_prepare(tmp_path, capsys):
    for name, frames in (
        ("black", [picture(0) * 0] * 6),
        ("grey", [picture(0) * 0 + 90] * 6),
        ("frozen", [picture(0)] * 6),
    ):
        write(tmp_path / f"{name}.mp4", [frame.astype(np.uint8) for frame in frames])
        assert main(["prepare", str(tmp_path / f"{name}.mp4"), "--out", str(tmp_path / "o"), *CAMERA]) == 2
        said = capsys.readouterr().err
        assert ("all 6 frames are one picture" if name == "frozen" else "6 of 6 frames are black") in said
        assert "000000, 000001" in said and not (tmp_path / "o").exists()


def test_metadata_that_are_no_text_do_not_hide_the_pictures(tmp_path):
    """A title in another encoding, as recorders write it, and as long as before: its element states the length."""
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        container.metadata["title"] = "OPERATION"
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        for shown in pictures(3):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="rgb24")))
        container.mux(stream.encode())
    data = (tmp_path / "a.mkv").read_bytes()
    assert data.count(b"OPERATION") == 1
    title = b"OP\xc4RATI\xffN"
    assert len(title) == len(b"OPERATION")
    (tmp_path / "a.mkv").write_bytes(data.replace(b"OPERATION", title))
    assert video_facts(tmp_path / "a.mkv").count == 3


def test_a_truncated_video_is_refused(tmp_path):
    file = write(tmp_path / "a.mkv", pictures(40))
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 2])
    facts = video_facts(file)
    assert 0 < facts.count < 40, "a stream that says nothing of its length ends where it ends"
    mp4 = write(tmp_path / "a.mp4", pictures(40), options={"movflags": "faststart"})
    with_index = mp4.read_bytes()
    mp4.write_bytes(with_index[: len(with_index) * 3 // 4])
    with pytest.raises(InputError, match=r"a\.mp4: "):
        video_facts(mp4)


def test_av1_and_other_codecs_are_read(tmp_path):
    for name, codec in (("a.mkv", "libsvtav1"), ("b.mp4", "libx265"), ("c.webm", "libvpx"), ("d.mov", "mjpeg")):
        frames = pictures(8)
        write(tmp_path / name, frames, codec, layout="yuvj420p" if codec == "mjpeg" else "yuv420p")
        facts = video_facts(tmp_path / name)
        assert (facts.count, facts.width, facts.height) == (8, WIDTH, HEIGHT), name
        assert all(apart(a, b) < CLOSE for a, b in zip(video_pictures(tmp_path / name, list(range(8))), frames)), name
    if hasattr(os, "sched_getscheduler"):
        assert os.sched_getscheduler(0) == os.SCHED_OTHER, "an encoder left this process in a real-time class"


def test_high_dynamic_range_is_refused(tmp_path):
    write(tmp_path / "a.mkv", pictures(4), "libx265", layout="yuv420p10le", transfer=16)
    with pytest.raises(InputError, match="high dynamic range"):
        video_facts(tmp_path / "a.mkv")


def test_a_file_without_pictures_is_no_video(tmp_path):
    import av

    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(InputError, match="holds no pictures"):
        video_facts(tmp_path / "a.mp4")
