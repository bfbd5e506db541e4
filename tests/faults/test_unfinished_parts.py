"""Parts that are added to a prepared folder: depth, masks and poses stay consistent with `sequence.toml`."""

import errno
import os

import msgspec
import numpy as np
import pytest
from common_folder import FRAMES, HEIGHT, WIDTH, written
from tiny import assert_refused

from endotsr.clips.masks import make_masks
from endotsr.clips.masks.make_masks import enter_masks
from endotsr.clips.masks.propose_masks import Proposal
from endotsr.clips.opencv.png import read_png
from endotsr.clips.prepare import make_depth
from endotsr.clips.prepare.make_depth import write_depth
from endotsr.clips.prepare.pose_record import as_now
from endotsr.clips.prepare.relative_depth import MadeDepth
from endotsr.clips.sequences.sequence_file import DepthEntry, MaskEntry, read_sequence_file, write_sequence_file
from endotsr.errors import InputError
from endotsr.untrusted.writing import new_folder, replace_file, replacing_folder


def far(folder):
    """Depth of 400 mm for all frames, whose stored step differs from that of `written`."""
    return MadeDepth(iter([np.full((HEIGHT, WIDTH), 400.0, np.float32)] * FRAMES), "computed", "")


def metres(folder):
    """The depth of the first frame as a reader of `sequence.toml` sees it, and the names in the folder."""
    entry = read_sequence_file(folder).depth
    level = read_png(folder / "depth" / "000000.png").max()
    return (float(level) * entry.scale if entry else None), sorted(path.name for path in folder.iterdir())


def interrupted(*_, **__):
    raise KeyboardInterrupt


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(errno.ENOSPC, "No space left on device")])
def test_depth_keeps_its_scale_if_the_record_is_not_written(tmp_path, monkeypatch, error):
    """The new levels were read in the old steps: 400 mm became 50 mm in silence."""
    written(tmp_path / "clip")
    before = metres(tmp_path / "clip")

    def fails(*_):
        raise error

    monkeypatch.setattr(make_depth, "replace_text", fails)
    with pytest.raises((KeyboardInterrupt, OSError)):
        write_depth(tmp_path / "clip", far(tmp_path / "clip"), replace=True)
    assert metres(tmp_path / "clip") == before


def test_depth_has_its_scale_if_the_removal_of_the_old_one_is_interrupted(tmp_path, monkeypatch):
    written(tmp_path / "clip")
    monkeypatch.setattr("endotsr.untrusted.writing.shutil.rmtree", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_depth(tmp_path / "clip", far(tmp_path / "clip"), replace=True)
    assert metres(tmp_path / "clip")[0] == pytest.approx(400, rel=1e-3)


def test_masks_keep_their_polarity_if_the_record_is_not_written(tmp_path, monkeypatch):
    """White was written as excluded where the record said black."""
    file = written(tmp_path / "clip")
    write_sequence_file(msgspec.structs.replace(file, masks=MaskEntry(excluded_value="black")), tmp_path / "clip")
    before = read_png(tmp_path / "clip/masks/000000.png")
    proposal = Proposal([np.eye(HEIGHT, WIDTH, dtype=bool)] * FRAMES, "carried")
    monkeypatch.setattr(make_masks, "replace_text", interrupted)
    with pytest.raises(KeyboardInterrupt):
        enter_masks(tmp_path / "clip", replace=True, propose=lambda clip: proposal)
    np.testing.assert_array_equal(read_png(tmp_path / "clip/masks/000000.png"), before)


def test_depth_keeps_masks_that_were_added_meanwhile(tmp_path):
    """The command ended with the `sequence.toml` of its beginning, without the masks of another one."""
    file = written(tmp_path / "clip", masks=False)

    def planes():
        yield from far(tmp_path).frames
        write_sequence_file(msgspec.structs.replace(file, masks=MaskEntry(proposed=True)), tmp_path / "clip")

    write_depth(tmp_path / "clip", MadeDepth(planes(), "computed", ""), replace=True)
    found = read_sequence_file(tmp_path / "clip")
    assert found.masks == MaskEntry(proposed=True) and found.depth and found.depth.method == "computed"


def test_poses_are_not_recorded_beside_other_depth(tmp_path):
    file = written(tmp_path / "clip")
    masked = msgspec.structs.replace(file, masks=MaskEntry(proposed=True))
    write_sequence_file(masked, tmp_path / "clip")
    assert as_now(tmp_path / "clip", file) == masked
    write_sequence_file(msgspec.structs.replace(file, depth=DepthEntry(scale=0.1)), tmp_path / "clip")
    with pytest.raises(InputError, match="was changed while the poses were estimated"):
        as_now(tmp_path / "clip", file)


def test_a_new_folder_without_its_record_is_removed(tmp_path):
    with pytest.raises(KeyboardInterrupt), replacing_folder(tmp_path / "new", then=interrupted):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", [["masks"], ["depth", "--flat"], ["poses"]])
def test_a_clip_without_permission_is_refused_before_the_work(command, tmp_path, capsys, monkeypatch):
    written(tmp_path / "clip")
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)  # as root, which may write everywhere
    words = [command[0], str(tmp_path / "clip"), *command[1:], "--replace"]
    assert_refused(capsys, words, f"{tmp_path / 'clip'}: cannot be written: no permission")


def test_errors_name_the_file_that_was_asked_for(tmp_path):
    """A full disk named no file, or a temporary one that is no longer there."""

    def full(path):
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError) as raised:
        replace_file(tmp_path / "scene.ply", full)
    assert raised.value.filename == str(tmp_path / "scene.ply")
    with pytest.raises(InputError) as refused, new_folder(tmp_path / "clip") as folder:
        raise InputError(f"{folder}/images/000000.png: cannot be written: No space left on device")
    assert str(refused.value).startswith(f"{tmp_path}/clip/images/000000.png: ")


def test_a_link_to_an_empty_folder_is_named_as_one(tmp_path):
    """It ended with `Not a directory`."""
    (tmp_path / "disk").mkdir()
    (tmp_path / "clip").symlink_to("disk")
    with pytest.raises(InputError, match="clip: is a link"), new_folder(tmp_path / "clip"):
        pass
    assert (tmp_path / "clip").is_symlink()
