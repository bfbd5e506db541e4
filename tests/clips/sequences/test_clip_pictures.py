"""Pictures of a clip that are decoded when they are asked for, and the fingerprint of their files."""

import dataclasses

import numpy as np
import pytest
from common_folder import written

from endotsr.clips.flow import clip_flows
from endotsr.clips.flow.clip_flows import motion_of
from endotsr.clips.opencv.png import write_png
from endotsr.clips.prepare.editing import cropped
from endotsr.clips.sequences.clip_pictures import LeftPictures, all_decoded, fingerprint, left_pictures
from endotsr.clips.sequences.layouts.common import describe_prepared
from endotsr.errors import InputError


@pytest.fixture
def clip(tmp_path):
    written(tmp_path / "clip")
    return describe_prepared(tmp_path / "clip")


def test_items_and_slices_are_those_of_the_clip(clip):
    pictures = left_pictures(clip)
    every = [pair.left for pair in clip.pictures(list(range(clip.count)))]
    assert isinstance(pictures, LeftPictures) and len(pictures) == len(every)
    for found in (list(pictures), all_decoded(pictures), [*pictures[:2], *pictures[2:]]):
        np.testing.assert_array_equal(found, every)
    np.testing.assert_array_equal(pictures[-1], every[-1])
    with pytest.raises(IndexError):
        pictures[len(every)]


def test_a_clip_without_a_file_per_frame_is_decoded_at_once(clip):
    pictures = left_pictures(dataclasses.replace(clip, images=[]))
    assert isinstance(pictures, list) and len(pictures) == clip.count


def test_kept_flows_are_found_without_decoding_the_clip(clip, tmp_path, monkeypatch):
    monkeypatch.setattr(clip_flows, "flow_folder", lambda: tmp_path / "flows")
    first = motion_of(left_pictures(clip))
    decoded = []

    def counted(wanted):
        decoded.extend(wanted)
        return clip.pictures(wanted)

    second = motion_of(left_pictures(dataclasses.replace(clip, pictures=counted)))
    assert set(decoded) == {0} and clip.count > 2
    np.testing.assert_array_equal(first.forward.levels, second.forward.levels)


def test_another_picture_order_or_crop_has_another_fingerprint(clip):
    wide = clip.intrinsics
    crop = cropped(clip, (0, 0, wide.width - 2, wide.height))
    turned = dataclasses.replace(clip, images=[clip.images[0], *clip.images[:0:-1]])
    found = [fingerprint(LeftPictures(c), "") for c in (clip, crop, turned)]
    found.append(fingerprint(LeftPictures(clip), "another version"))
    file = clip.images[-1]
    picture = LeftPictures(clip)[-1].copy()
    picture[0, 0, 0] ^= 1
    write_png(file, picture)
    found.append(fingerprint(LeftPictures(clip), ""))
    assert len(set(found)) == 5


def test_a_file_that_is_no_picture_is_named(clip):
    clip.images[2].write_bytes(b"no picture")
    with pytest.raises(InputError, match=clip.images[2].name):
        all_decoded(left_pictures(clip))
