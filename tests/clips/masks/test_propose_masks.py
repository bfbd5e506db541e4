"""Proposed instrument masks: found on simulated instruments, absent without them, and marked as proposals."""

import json

import numpy as np
import pytest
from common_folder import FRAMES, written
from made_videos import files, write
from scoped_scenes import scene, through_a_scope

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.clips.masks.propose_masks import Proposal, propose_masks
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import FILE_NAME, read_sequence_file
from endotsr.config import PAPER, SequenceConfig


def iou(found, true):
    return np.mean([(a & b).sum() / (a | b).sum() for a, b in zip(found, true, strict=True)])


def test_a_simulated_instrument_is_found():
    pictures, true = scene("pulling")
    proposal = propose_masks(pictures)
    assert proposal.found and "5 of 5 frames" in proposal.reason
    assert iou(proposal.excluded, true) > 0.7 and proposal.outside == 0


@pytest.mark.parametrize("name", ["still", "breathing"])
def test_tissue_and_its_highlights_are_no_instrument(name):
    proposal = propose_masks(scene(name)[0])
    assert not proposal.found and "no grey region" in proposal.reason


def with_patch(picture, width, rise):
    """The picture with a grey patch at its left border, of which `rise` columns fade into the tissue."""
    share = np.clip((width - np.arange(picture.shape[1])) / rise, 0.0, 1.0)[None, :, None]
    share = np.where(np.arange(picture.shape[0])[:, None, None] < picture.shape[0] // 2, share, 0.0)
    return (share * 190 + (1 - share) * picture).astype(np.uint8)


def test_a_pale_region_that_fades_is_no_instrument_unless_it_continues_one():
    """Overexposed tissue fades into its surroundings; so does smoke around an instrument, which is still there."""
    pictures = scene("still")[0]
    tissue = np.broadcast_to(np.median(pictures[0].reshape(-1, 3), axis=0), pictures[0].shape).astype(np.uint8)
    sharp, faded = with_patch(tissue, 40, 1), with_patch(tissue, 90, 80)
    assert all(plane.any() for plane in propose_masks([sharp] * 3).excluded)
    proposal = propose_masks([faded] * 3)
    assert not proposal.found and "no grey region with an edge" in proposal.reason
    found = propose_masks([sharp, faded, faded]).excluded
    assert [plane.any() for plane in found] == [True, True, True]


def test_without_colour_there_is_no_proposal():
    pictures = [np.repeat(picture[..., :1], 3, axis=2) for picture in scene("pulling")[0]]
    assert "is not distinguishable" in propose_masks(pictures).reason
    assert not propose_masks([]).found


@pytest.mark.parametrize("name", ["pulling", "still"])
def test_a_round_field_of_view_is_found_and_not_taken_for_an_instrument(name, tmp_path, capsys):
    """Through a real codec; without the search for the border, whole frames were excluded."""
    pictures, true = scene(name)
    shown, inside = through_a_scope(pictures)
    write(tmp_path / "a.mp4", shown, options={"crf": "20"})
    assert main(["masks", str(tmp_path / "a.mp4"), "--out", str(tmp_path / "m")]) == 0
    said = capsys.readouterr().out
    assert "field of view: " in said and "warning" not in said
    found = [read_png(file) > 0 for file in sorted((tmp_path / "m/masks").iterdir())]
    for mask, tool in zip(found, true, strict=True):
        assert mask[~inside].mean() > 0.99
        assert mask[inside & ~tool].mean() < 0.25, "the view stays"
    if name == "pulling":
        tools = [mask & inside for mask in found]
        assert iou(tools, [tool & inside for tool in true]) > 0.4


def test_a_proposal_that_leaves_no_tissue_is_refused_with_the_frames(tmp_path, capsys, monkeypatch):
    files(tmp_path, "source", scene("pulling")[0])
    whole = np.ones((128, 160), bool)
    refused, warned = "hardly any tissue in 3 of 5 frames: 0000, 0001, 0002", "tissue is left in 2 frames: 0, 1"
    for count, code in ((3, 2), (2, 0)):
        masks = [whole if i < count else ~whole for i in range(5)]
        made = Proposal(masks, "made up", 0.0, tuple(range(count)))
        monkeypatch.setattr("endotsr.clips.masks.make_masks.propose_masks", lambda pictures, made=made: made)
        assert main(["masks", str(tmp_path / "source"), "--out", str(tmp_path / "m")]) == code
        said = capsys.readouterr()
        assert refused in said.err if code else warned in said.out


def drifting(offset):
    """Tissue with a texture that does not move, and a grey disc in the middle at `offset`."""
    rng = np.random.default_rng(5)
    texture = rng.integers(-25, 25, (16, 20)).repeat(8, 0).repeat(8, 1)
    picture = np.clip(np.stack([170 + texture, 70 + texture // 2, 60 + texture // 2], 2), 0, 255).astype(np.uint8)
    row, column = np.mgrid[:128, :160]
    inside = (row - 64) ** 2 + (column - 60 - offset) ** 2 < 12**2
    grain = rng.integers(-20, 20, (128, 160))
    picture[inside] = (130 + np.roll(grain, offset, 1)[inside])[:, None].astype(np.uint8)
    return picture, inside


def test_motion_tells_a_tool_inside_the_picture_from_a_grey_spot():
    moving = [drifting(5 * i) for i in range(4)]
    proposal = propose_masks([picture for picture, _ in moving])
    assert proposal.found and iou(proposal.excluded, [inside for _, inside in moving]) > 0.5
    assert not propose_masks([drifting(0)[0]] * 4).found


def test_masks_are_entered_as_proposals(tmp_path, capsys):
    clip = tmp_path / "clip"
    written(clip, masks=False)
    pictures, true = scene("pulling")
    for i, (picture, mask) in enumerate(zip(pictures, true)):
        write_png(clip / "images" / f"{i:06d}.png", picture)
        depth = 4000 + i + 10 * np.arange(mask.shape[1])[None, :]
        write_png(clip / "depth" / f"{i:06d}.png", np.where(mask, 0, depth).astype(np.uint16))
    text = (clip / FILE_NAME).read_text().replace("width = 32", "width = 160").replace("height = 24", "height = 128")
    (clip / FILE_NAME).write_text(text)
    assert len(pictures) == FRAMES and main(["masks", str(clip)]) == 0
    assert "inspect " in capsys.readouterr().out and (clip / "proposed_masks.png").is_file()
    found = read_sequence_file(clip)
    assert found.masks is not None and found.masks.proposed and found.masks.excluded_value == "white"
    sequence = read_sequence(clip, SequenceConfig(), 0.2)
    assert iou(~sequence.masks, true) > 0.7 and any("proposed by a program" in note for note in sequence.notes)
    assert "proposed-masks" in [finding.code for finding in check_sequence(clip, PAPER).findings]
    assert main(["masks", str(clip)]) == 2 and "has masks already" in capsys.readouterr().err
    assert main(["masks", str(clip), "--replace"]) == 0


def test_a_mask_of_all_frames_is_united_with_the_proposal(tmp_path, capsys):
    """A stated field of view stays; it is not a reason to refuse, and not replaced."""
    pictures, true = scene("pulling")
    files(tmp_path, "source", pictures)
    static = np.zeros(pictures[0].shape[:2], bool)
    static[-20:] = True
    write_png(tmp_path / "view.png", np.where(static, 255, 0).astype(np.uint8))
    words = ["--camera", "140", "140", "80", "64", "--masks", str(tmp_path / "view.png")]
    assert main(["prepare", str(tmp_path / "source"), "--out", str(tmp_path / "clip"), *words]) == 0
    assert main(["masks", str(tmp_path / "clip")]) == 0 and "united" in capsys.readouterr().out
    found = [read_png(file) > 0 for file in sorted((tmp_path / "clip/masks").iterdir())]
    assert all(mask[static].all() for mask in found)
    assert iou([mask & ~static for mask in found], [tool & ~static for tool in true]) > 0.6


def test_masks_of_any_source_keep_their_mark(tmp_path):
    files(tmp_path, "source", scene("pulling")[0])
    assert main(["masks", str(tmp_path / "source"), "--out", str(tmp_path / "found")]) == 0
    assert json.loads((tmp_path / "found/proposal.json").read_text())["proposed"] is True
    assert read_png(tmp_path / "found/masks/0000.png").max() == 255
    words = ["--camera", "140", "140", "80", "64", "--masks", str(tmp_path / "found/masks")]
    assert main(["prepare", str(tmp_path / "source"), "--out", str(tmp_path / "clip"), *words]) == 0
    masks = read_sequence_file(tmp_path / "clip").masks
    assert masks is not None and masks.proposed


def test_masks_take_the_place_of_those_of_a_prepared_sequence(tmp_path):
    written(tmp_path / "clip")
    files(
        tmp_path, "m", [np.where(np.arange(32) < 5 + i, 255, 0)[None].repeat(24, 0).astype("u1") for i in range(FRAMES)]
    )
    assert main(["prepare", str(tmp_path / "clip"), "--out", str(tmp_path / "b"), "--masks", str(tmp_path / "m")]) == 0
    for i in range(FRAMES):
        assert (read_png(tmp_path / f"b/masks/{i:06d}.png") > 0).sum() == 24 * (5 + i)


def test_nothing_found_writes_nothing(tmp_path, capsys):
    files(tmp_path, "source", scene("still")[0])
    assert main(["masks", str(tmp_path / "source"), "--out", str(tmp_path / "found")]) == 1
    assert "no masks proposed" in capsys.readouterr().out and not (tmp_path / "found").exists()


@pytest.mark.data
def test_real_instruments_are_found():
    folder = data_folder("endonerf_pulling")
    files = [sorted((folder / name).iterdir())[:3] for name in ("images", "gt_masks")]
    proposal = propose_masks([read_png(file) for file in files[0]])
    assert iou(proposal.excluded, [read_png(file) > 0 for file in files[1]]) > 0.55
