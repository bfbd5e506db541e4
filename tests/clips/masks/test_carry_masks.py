"""Masks of key frames carried to the others: exact for exact flows, named where the two sides disagree, by command."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from common_folder import written

from data_folder import data_folder
from endotsr.cli.main import main
from endotsr.cli.masks import carrying_command
from endotsr.clips.flow.clip_flows import ClipFlows, motion_of
from endotsr.clips.masks.carry_masks import LEAST_GAIN, carried_once, carry_masks
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.opencv.regions import grown_by_disc
from endotsr.clips.simulator.frames import make_scene, simulated_frames
from endotsr.clips.simulator.scenes import named_scene
from endotsr.config import with_settings
from endotsr.errors import InputError

SIZE = (60, 80)


def tool(left: int) -> np.ndarray:
    """A square of 20 px at a column."""
    mask = np.zeros(SIZE, bool)
    mask[20:40, left : left + 20] = True
    return mask


def sliding(count: int, step: int = 3) -> tuple[ClipFlows, list[np.ndarray]]:
    """A tool that slides to the right, tissue around it that moves with it, and its masks: no pixel is uncovered."""
    masks = [tool(5 + step * i) for i in range(count)]
    field = np.stack([np.full(SIZE, step), np.zeros(SIZE)]).astype(np.float32)
    return ClipFlows([field.copy() for _ in range(count - 1)], [-field for _ in range(count - 1)]), masks


def overlap(one, other) -> float:
    return (one & other).sum() / (one | other).sum()


def test_exact_flows_carry_a_mask_exactly():
    motion, masks = sliding(12)
    found = carry_masks(motion, {0: masks[0], 11: masks[11]})
    for mask, true in zip(found.excluded, masks, strict=True):
        np.testing.assert_array_equal(mask, true)
    assert found.agreement == [1.0] * 12 and found.next_key is None and found.distrusted == []


def test_the_flow_of_the_inside_serves_the_edge():
    """Dense flow smears the motion of the tool into the tissue: half of it 4 px inside, none outside."""
    motion, masks = sliding(2, step=6)
    smeared = motion.backward[0].copy()
    inner = ~grown_by_disc(~masks[1], 4)
    smeared[0][~masks[1]] = 0
    smeared[0][masks[1] & ~inner] *= 0.5
    moved = carried_once(masks[0].astype(np.float32), smeared) > 0.5
    plain = np.zeros(SIZE, bool)
    columns = np.clip(np.arange(80) + smeared[0], 0, 79).round().astype(int)
    plain = np.take_along_axis(masks[0], columns, axis=1)
    assert overlap(moved, masks[1]) > overlap(plain, masks[1]) + 0.05


def test_a_margin_grows_the_mask_and_takes_either_side_in_the_middle():
    still = ClipFlows([np.zeros((2, *SIZE), np.float32)] * 4, [np.zeros((2, *SIZE), np.float32)] * 4)
    one, other = tool(5), tool(15)
    found = carry_masks(still, {0: one, 4: other}, margin=3)
    np.testing.assert_array_equal(found.excluded[0], grown_by_disc(one, 3))
    np.testing.assert_array_equal(found.excluded[2], grown_by_disc(one | other, 3))  # half way, one side is enough
    np.testing.assert_array_equal(carry_masks(still, {0: one, 4: other}).excluded[1], one)  # the nearer side
    disc = grown_by_disc(np.pad([[True]], 5), 3)
    rows, columns = np.mgrid[-5:6, -5:6]
    np.testing.assert_array_equal(disc, rows**2 + columns**2 <= 9)


def test_an_empty_and_a_full_key_are_keys():
    still = ClipFlows([np.zeros((2, *SIZE), np.float32)] * 2, [np.zeros((2, *SIZE), np.float32)] * 2)
    empty, full = np.zeros(SIZE, bool), np.ones(SIZE, bool)
    assert not np.any(carry_masks(still, {0: empty, 2: empty}).excluded)
    assert np.all(carry_masks(still, {0: full, 2: full}).excluded)
    assert carry_masks(still, {0: empty, 2: empty}).agreement == [1.0] * 3
    assert carry_masks(still, {0: empty, 2: full}).distrusted == [1]


def test_one_key_is_carried_to_all_frames_and_none_is_trusted():
    motion, masks = sliding(7)
    found = carry_masks(motion, {3: masks[3]})
    assert all(map(np.array_equal, found.excluded, masks))
    assert found.distrusted == [0, 1, 2, 4, 5, 6] and found.next_key in (0, 6) and found.gain == pytest.approx(3 / 7)


def test_an_instrument_that_stops_keeps_its_place():
    motion, masks = sliding(10)
    for i in range(5, 9):
        motion.forward[i][:] = motion.backward[i][:] = 0
    true = masks[:6] + 4 * [masks[5]]
    found = carry_masks(motion, {0: true[0], 9: true[9]})
    assert all(map(np.array_equal, found.excluded, true)) and found.next_key is None and found.gain < LEAST_GAIN


def test_an_instrument_is_carried_through_smoke():
    """Copies of the nearest key miss 45 % of the instrument in the worst frame."""
    settings = with_settings(named_scene("smoke"), width=160, height=128, frames=13)
    frames = list(simulated_frames(make_scene(settings)))
    true = [frame.excluded for frame in frames]
    motion = motion_of([frame.image.transpose(1, 2, 0) for frame in frames])
    keys = {i: true[i] for i in (0, 6, 12)}
    found = carry_masks(motion, keys, margin=2).excluded
    between = [i for i in range(13) if i not in keys]
    recall = [(found[i] & true[i]).sum() / true[i].sum() for i in between]
    lost = [(found[i] & ~true[i]).sum() / (~true[i]).sum() for i in between]
    nearest = [true[min(keys, key=lambda k, i=i: abs(k - i))] for i in between]
    copied = [(plane & true[i]).sum() / true[i].sum() for plane, i in zip(nearest, between, strict=True)]
    assert min(recall) > 0.97 and max(lost) < 0.06 and min(copied) < 0.6


def test_frames_beyond_the_keys_are_named_and_drawn_next():
    motion, masks = sliding(9)
    found = carry_masks(motion, {2: masks[2], 4: masks[4]})
    assert found.distrusted == [0, 1, 5, 6, 7, 8] and found.next_key == 8
    np.testing.assert_array_equal(found.excluded[8], masks[8])
    assert carry_masks(motion, {4: masks[4]}).distrusted == [0, 1, 2, 3, 5, 6, 7, 8]


def test_the_next_key_lies_where_the_sides_disagree_far_from_keys():
    """The second of two gaps has flows of no motion, although the tool moves."""
    motion, masks = sliding(11)
    for i in range(5, 10):
        motion.forward[i][:] = motion.backward[i][:] = 0
    found = carry_masks(motion, {0: masks[0], 5: masks[5], 10: masks[10]})
    assert found.next_key in (7, 8) and found.agreement[3] == 1.0 > found.agreement[7]
    better = carry_masks(motion, {0: masks[0], 5: masks[5], found.next_key: masks[found.next_key], 10: masks[10]})
    assert np.mean(better.agreement) > np.mean(found.agreement)


def test_wrong_keys_are_refused():
    motion, masks = sliding(3)
    with pytest.raises(InputError, match="no key frame is given"):
        carry_masks(motion, {})
    with pytest.raises(InputError, match="key frame 3 is not a frame of the clip; use one of 0 to 2"):
        carry_masks(motion, {3: masks[0]})
    with pytest.raises(InputError, match="key 1 is 40x60, the pictures 80x60"):
        carry_masks(motion, {1: masks[0][:, :40]})


def test_the_command_carries_the_masks_of_a_folder(tmp_path, capsys):
    folder = tmp_path / "clip"
    written(folder)
    names = sorted(file.stem for file in (folder / "images").iterdir())
    height, width = read_png(folder / "images" / f"{names[0]}.png").shape[:2]
    mask = np.zeros((height, width), np.uint8)
    mask[: height // 2, : width // 3] = 255
    keys = tmp_path / "keys"
    keys.mkdir()
    for name in (names[0], names[-1]):
        write_png(keys / f"{name}.png", mask)
    words = ["masks", str(folder), "--keys", str(keys), "--margin", "0", "--replace"]
    assert main([*words, "--json", str(tmp_path / "said.json")]) == 0
    assert "carried from 2 key frames, margin 0 px" in capsys.readouterr().out
    assert json.loads((tmp_path / "said.json").read_text())["found"]
    for name in (names[0], names[-1]):
        np.testing.assert_array_equal(read_png(folder / "masks" / f"{name}.png"), mask)
    assert len(list((folder / "masks").iterdir())) == len(names)
    write_png(keys / "other.png", mask)
    assert main(words) == 2
    assert "other.png: is not the name of a frame; use names such as" in capsys.readouterr().err
    assert main(["masks", str(folder), "--keys", str(tmp_path / "none"), "--replace"]) == 2
    assert "none: cannot be read" in capsys.readouterr().err
    assert main(["masks", str(folder), "--margin", "5"]) == 2
    assert "--margin has no effect without --keys" in capsys.readouterr().err


def test_a_source_that_is_not_prepared_gets_its_masks_in_a_folder(tmp_path, capsys):
    (tmp_path / "my clip").mkdir()
    pictures, keys = tmp_path / "my clip" / "images", tmp_path / "keys"
    pictures.mkdir()
    keys.mkdir()
    rng = np.random.default_rng(0)
    for name in "abc":
        write_png(pictures / f"{name}.png", rng.integers(60, 200, (48, 64, 3), np.uint8))
    mask = np.zeros((48, 64), np.uint8)
    mask[:24, :20] = 255
    write_png(keys / "a.png", mask)
    command = carrying_command(tmp_path / "my clip")
    assert command.endswith(" --keys keys.json --out 'my clip_masks' --replace")
    out = tmp_path / "my clip_masks"
    words = ["masks", str(tmp_path / "my clip"), "--keys", str(keys), "--margin", "0", "--out", str(out)]
    for more in ([], ["--replace"]):
        assert main([*words, *more]) == 0
        assert f"next: endotsr prepare '{tmp_path / 'my clip'}' --masks '{out / 'masks'}'" in capsys.readouterr().out
    np.testing.assert_array_equal(read_png(out / "masks" / "a.png"), mask)
    assert main(words) == 2 and "exists already" in capsys.readouterr().err
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "file").touch()
    assert main([*words[:-1], str(tmp_path / "other"), "--replace"]) == 2
    assert "is not replaced: it holds no proposal.json" in capsys.readouterr().err
    assert main(words[:-2]) == 2
    assert "has no sequence.toml; `endotsr prepare" in capsys.readouterr().err


def files_in(folder: Path) -> dict[Path, bytes]:
    return {file: file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()}


def test_proposed_masks_join_and_replace_no_input(tmp_path, capsys, monkeypatch):
    for name in ("raw/images", "keys", "earlier/masks/keys"):
        (tmp_path / name).mkdir(parents=True)
    for name in "abc":
        write_png(tmp_path / f"raw/images/{name}.png", np.full((48, 64, 3), 90, np.uint8))
    mask = np.pad(np.full((24, 20), 255, np.uint8), ((0, 24), (0, 44)))
    for folder in ("keys", "earlier/masks", "earlier/masks/keys"):
        write_png(tmp_path / folder / "a.png", mask)
    (tmp_path / "earlier/proposal.json").write_text("{}")
    written(tmp_path / "clip", masks=True)
    write_png(tmp_path / "clip/masks/keys.png", mask)
    monkeypatch.setattr("endotsr.clips.masks.make_masks.motion_of", lambda pictures: pytest.fail("too late"))
    monkeypatch.chdir(tmp_path)
    before = files_in(tmp_path)
    replaced = "masks would be replaced; copy the masks of the key frames to another folder"
    for source, keys, out, said in (
        ("raw", "keys", "raw/o", "raw/o: is inside the source raw; choose an --out outside of it"),
        ("raw/images", "keys", "raw/images", "raw/images: is inside the source raw/images; choose an --out outside"),
        ("raw", "keys", "keys/o", "keys/o: is inside the masks of the key frames keys; choose an --out outside of it"),
        ("earlier/masks", "keys", "earlier", "earlier/masks: is inside earlier, which would be replaced; choose an"),
        ("raw", "earlier/masks", "earlier", f"--keys earlier/masks: earlier/{replaced}"),
        ("raw", "earlier/masks/keys", "earlier", f"--keys earlier/masks/keys: earlier/{replaced}"),
        ("clip", "clip/masks", None, f"--keys clip/masks: clip/{replaced}"),
    ):
        words = ["masks", source, "--keys", keys, "--replace", *(["--out", out] if out else [])]
        assert main(words) == 2 and said in " ".join(capsys.readouterr().err.split()), words
        assert files_in(tmp_path) == before


def rows_of_the_page(column: int) -> dict[int, tuple[float, float]]:
    """Key distance -> (mean, worst) as printed in conventions, *Masks*."""
    page = (Path(__file__).parents[3] / "docs/specification/conventions.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| (\d+) frames \| (.+) \|$", page, re.MULTILINE)
    cells = {int(key): [float(value) for value in row.split(" | ")] for key, row in found}
    return {key: (row[2 * column], row[2 * column + 1]) for key, row in cells.items()}


@pytest.mark.slow
@pytest.mark.data
@pytest.mark.parametrize(("clip", "column"), [("endonerf_pulling", 0), ("endonerf_cutting", 1)])
def test_the_table_of_the_specification(clip, column):
    """Copying the nearest key gives a mean of 0.851 on pulling with a key every ten frames, the plain flow 0.909."""
    folder = data_folder(clip)
    pictures = [read_png(file) for file in sorted((folder / "images").iterdir())]
    true = [read_png(file) for file in sorted((folder / "gt_masks").iterdir())]
    true = [(plane if plane.ndim == 2 else plane[..., 0]) > 127 for plane in true]
    motion, last = motion_of(pictures), len(true) - 1
    for distance, (mean, worst) in rows_of_the_page(column).items():
        keys = {*range(0, last, distance), last}
        found = carry_masks(motion, {key: true[key] for key in keys})
        scores = [overlap(found.excluded[i], true[i]) for i in range(last) if i not in keys]
        assert np.mean(scores) == pytest.approx(mean, abs=0.002), (distance, np.mean(scores))
        assert np.min(scores) == pytest.approx(worst, abs=0.006), (distance, np.min(scores))


def test_a_key_of_another_size_is_refused_also_for_a_single_picture(tmp_path, capsys):
    for name in ("one", "keys"):
        (tmp_path / name).mkdir()
    write_png(tmp_path / "one" / "a.png", np.full((48, 64, 3), 90, np.uint8))
    write_png(tmp_path / "keys" / "a.png", np.eye(24, 32, dtype=np.uint8) * 255)
    (tmp_path / "keys" / "._a.png").write_bytes(b"\0\5\x16\7")  # written by macOS beside a file
    said = "a.png: 32x24 pixels, the pictures of the clip have 64x48"
    for words in (["--out", str(tmp_path / "o")], ["--draw", str(tmp_path / "a.html")]):
        assert main(["masks", str(tmp_path / "one"), "--keys", str(tmp_path / "keys"), *words]) == 2
        assert said in capsys.readouterr().err
    assert main(["masks", str(tmp_path / "one"), "--layout", "pictures"]) == 2
    assert "--layout has no effect without --out or --draw" in capsys.readouterr().err
