"""Videos: what they hold, decoded or refused, and never another picture, time or orientation in silence."""

import av
import numpy as np
import pytest
from made_videos import HEIGHT, WIDTH, pictures, write

from endotsr.clips.formats.video_file import video_facts, video_pictures
from endotsr.clips.sequences.read import read_sequence
from endotsr.errors import InputError

CLOSE = 8.0  # mean grey levels that a codec may cost; a moment later differs by more


def apart(a, b):
    return float(np.abs(a.astype(int) - b.astype(int)).mean())


def test_progressive_video_is_not_touched(tmp_path):
    frames = pictures()
    write(tmp_path / "a.mkv", frames, "ffv1", layout="bgr0")
    facts = video_facts(tmp_path / "a.mkv")
    assert (facts.interlaced, facts.turn, facts.count, facts.codec) == (False, 0, 12, "ffv1")
    for found, made in zip(video_pictures(tmp_path / "a.mkv", [0, 3, 11]), (frames[0], frames[3], frames[11])):
        np.testing.assert_array_equal(found, made)


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


@pytest.mark.parametrize(
    ("kept", "end", "how"), [(0.5, "", {}), (0.95, "3.", {"codec": "ffv1", "layout": "bgr0"})], ids=["half", "most"]
)
def test_a_twentieth_that_is_missing_is_named(kept, end, how, tmp_path):
    """Three minutes of an hour; half of an interrupted copy was half of the operation, in silence."""
    file = write(tmp_path / "a.mkv", pictures(100), **how)
    assert not video_facts(file).remarks
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * kept)])
    facts = video_facts(file)
    (said,) = facts.remarks
    assert said.startswith(f"states 4 seconds, but its pictures end after {end}") and 0 < facts.count < 100


def write_after(seconds, file, sound=0):
    """A Matroska file whose clock begins at `seconds`, with `sound` packets of sound, 23 ms each."""
    with av.open(str(file), "w") as container:
        stream = container.add_stream("libx264", rate=25)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        heard = container.add_stream("aac", rate=44100) if sound else None
        for i, shown in enumerate(pictures(10)):
            frame = av.VideoFrame.from_ndarray(shown, format="rgb24")
            frame.pts = 25 * seconds + i
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
        for k in range(sound):
            frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
            frame.sample_rate, frame.pts = 44100, 1024 * k
            container.mux(heard.encode(frame))
        container.mux(heard.encode() if heard else [])
    return file


@pytest.mark.parametrize("tag", [b"DURATION", b"DURATIOX"])  # without the tag, the length of the file counts
@pytest.mark.parametrize(("seconds", "sound"), [(0, 0), (60, 0), (0, 200)])
def test_a_late_clock_or_a_longer_sound_does_not_make_a_video_truncated(tag, seconds, sound, tmp_path):
    file = write_after(seconds, tmp_path / "a.mkv", sound)
    file.write_bytes(file.read_bytes().replace(b"DURATION", tag))
    assert not video_facts(file).remarks


def test_a_file_without_pictures_is_no_video(tmp_path):
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(InputError, match="holds no pictures"):
        video_facts(tmp_path / "a.mp4")
