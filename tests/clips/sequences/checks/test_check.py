"""`endotsr check`: each of the wrong inputs, made by a script, gives the finding it must give, and no wrong alarm."""

import json
import re
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from common_folder import moving, written
from raw_sources import write_video
from stereo_pairs import slanted_pair, stereo_folder
from wrong_clips import FRAMES, WRONG, cut, each, half_white

from data_folder import first_frames
from endonerf_writer import write_endonerf
from endotsr.cli.main import main
from endotsr.clips.opencv.png import read_png, write_png
from endotsr.clips.sequences.checks.check import check_sequence
from endotsr.clips.sequences.checks.frames import rate_findings
from endotsr.clips.sequences.checks.guard import MOST, SAID_ALREADY
from endotsr.clips.sequences.forecast.cost import estimated_cost
from endotsr.clips.sequences.forecast.seconds import expected_frames
from endotsr.clips.sequences.forecast.work import Standing, at_start, gaussians_at_end, work_left
from endotsr.clips.sequences.read import read_sequence
from endotsr.clips.sequences.sequence_file import FILE_NAME
from endotsr.clips.simulator.settings import SimulatorSettings
from endotsr.clips.simulator.simulate import simulate
from endotsr.config import PAPER, SequenceConfig, config_from_dict
from endotsr.errors import InputError
from endotsr.training.fitting.state import new_training

SIXTY = expected_frames(60, PAPER)


@pytest.fixture(scope="module")
def sequence():
    return simulate(SimulatorSettings(width=64, height=48, frames=FRAMES)).sequence


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_input_gives_its_finding_and_a_training_judges_alike(case, sequence, tmp_path):
    """What the check refuses is refused, and its warnings are in the notes of what is accepted."""
    damage, code, level, frame = WRONG[case]
    write_endonerf(sequence, tmp_path / "clip")
    damage(tmp_path / "clip")
    checked = check_sequence(tmp_path / "clip", PAPER)
    matching = [f for f in checked.findings if f.code == code]
    assert matching, [f.line for f in checked.findings]
    assert matching[0].level == level and (frame is None or frame in [f.frame for f in matching])
    assert all(f.what and f.why and f.remedy and str(tmp_path) in f.where for f in checked.findings)
    if checked.refused:
        with pytest.raises(InputError):
            new_training(read_sequence(tmp_path / "clip", PAPER.sequence, PAPER.raster.near), PAPER)
        return
    notes = read_sequence(tmp_path / "clip", PAPER.sequence, PAPER.raster.near).notes
    said = [found[1] for note in notes if (found := re.match(r"(?:warning|note): ([\w-]+): ", note))]
    assert said == [f.code for f in checked.findings if f.code not in SAID_ALREADY]


def test_many_findings_of_one_kind_are_counted(sequence, tmp_path):
    write_endonerf(sequence, tmp_path / "clip")
    each(tmp_path / "clip", "images", half_white, range(7))
    notes = read_sequence(tmp_path / "clip", PAPER.sequence, 0.2).notes
    clipped = [note for note in notes if "clipped-frame" in note]
    assert len(clipped) == MOST and clipped[-1].endswith("(2 more of this kind)")


def test_a_right_sequence_has_no_finding(sequence, tmp_path):
    write_endonerf(sequence, tmp_path / "clip")
    checked = check_sequence(tmp_path / "clip", PAPER)
    assert checked.findings == [] and not checked.refused
    assert not any("warning" in note for note in read_sequence(tmp_path / "clip", PAPER.sequence, 0.2).notes)
    assert checked.facts["frames"] == FRAMES and checked.facts["cost"]["minutes"] > 0


@pytest.mark.parametrize("scale", [0.25, 2.0])
def test_a_size_that_a_training_refuses_is_found(scale, sequence, tmp_path):
    write_endonerf(sequence, tmp_path / "clip")
    config = msgspec.structs.replace(PAPER, sequence=SequenceConfig(scale=scale))
    (found,) = check_sequence(tmp_path / "clip", config).findings
    assert found.code == "picture-size" and found.level == "refusal"
    with pytest.raises(InputError) as error:
        read_sequence(tmp_path / "clip", config.sequence, 0.2)
    assert str(error.value) == found.what


def test_the_time_is_that_of_a_training_on_these_frames(sequence, tmp_path):
    write_endonerf(sequence, tmp_path / "sequence")
    training = msgspec.structs.replace(PAPER.training, visits_per_frame=1500)  # 8 training frames: 12000 iterations
    configs = (PAPER, msgspec.structs.replace(PAPER, training=training))
    once, twice = (check_sequence(tmp_path / "sequence", config).facts["cost"]["minutes"] for config in configs)
    assert twice == pytest.approx(2 * once, rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("fx = 30.0", "fx = -1.0", "sequence-file"),
        ("distortion = []", "distortion = [0.1, 0, 0, 0]", "distortion"),
        ("cx = 15.0", "cx = 29.0", "principal-point"),
        ("fy = 33.0", "fy = 66.0", "pixel-shape"),
        ("width = 32", "width = 64", "sequence-file"),
        ("frames = 5", "frames = 7", "cameras"),
        ('[depth]\nfolder = "depth"\nunit = "mm"', '[depth]\nfolder = "depth"\nunit = "m"', "depth-unit"),
    ],
)
def test_wrong_statements_of_the_common_format(tmp_path, old, new, code):
    written(tmp_path, poses=moving())
    file = tmp_path / FILE_NAME
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    assert code in [f.code for f in check_sequence(tmp_path, PAPER).findings]


@pytest.mark.parametrize(("baseline", "unit", "said"), [
    ("0.004", "mm", "0.004 mm apart; it looks like metres"), ("4200.0", "mm", "it looks like micrometres"),
    ("4.0", "mm", None), ("0.004", "m", None), ("540.0", "mm", None), ("0.004", "arbitrary", None),
])  # fmt: skip
def test_a_baseline_in_another_unit(tmp_path, baseline, unit, said):
    written(tmp_path, depth=False, right=True)
    file = tmp_path / FILE_NAME
    text = file.read_text().replace("baseline = 4.0", f"baseline = {baseline}")
    file.write_text(text.replace('unit = "mm"', f'unit = "{unit}"', 1))
    found = [f.what for f in check_sequence(tmp_path, PAPER).findings if f.code == "baseline-unit"]
    assert len(found) == (said is not None) and (said or "") in "".join(found)


@pytest.mark.parametrize(
    ("frames", "codes"), [("", {"mask"}), ("0:4", set()), ("1:5", {"mask"}), ("0:9", {"mask", "frames"})]
)
def test_a_damaged_file_counts_only_among_the_selected_frames(tmp_path, frames, codes):
    written(tmp_path)
    (tmp_path / "masks/000004.png").write_bytes(b"no mask")
    config = config_from_dict({"sequence": {"frames": frames}}, PAPER)
    checked = check_sequence(tmp_path, config)
    assert {f.code for f in checked.findings if f.level == "refusal"} == codes
    assert checked.facts["frames"] == (4 if frames in ("0:4", "1:5") else 5)


@pytest.mark.parametrize(("last", "uneven"), [(0.16, False), (0.32, True)])
def test_even_times_are_not_said_to_be_uneven(tmp_path, last, uneven):
    written(tmp_path, times=[0.0, 0.04, 0.08, 0.12, last])
    assert ("uneven-times" in [f.code for f in check_sequence(tmp_path, PAPER).findings]) == uneven


def test_what_the_common_format_lacks(tmp_path):
    written(tmp_path, masks=False, depth=False)
    found = {f.code: f for f in check_sequence(tmp_path, PAPER).findings}
    assert found["no-masks"].level == "note" and found["no-depth"].level == "refusal"


def test_an_inverted_picture_of_depth_is_found_by_the_stereo_pair(tmp_path):
    stereo_folder(tmp_path)
    assert main(["depth", str(tmp_path), "--nearest", "25", "--farthest", "120"]) == 0
    assert "inverted-depth" not in [f.code for f in check_sequence(tmp_path, PAPER).findings]
    disparity = slanted_pair()[2]
    stored = read_png(tmp_path / "depth/000000.png")
    write_png(tmp_path / "depth/000000.png", np.where(stored > 0, disparity * 100, 0).astype(np.uint16))
    found = [f for f in check_sequence(tmp_path, PAPER).findings if f.code == "inverted-depth"]
    assert found and found[0].level == "refusal" and "disparity" in found[0].remedy
    with pytest.raises(InputError, match="near and far are exchanged"):
        read_sequence(tmp_path, PAPER.sequence, PAPER.raster.near)


def test_cost_grows_with_the_clip_up_to_the_limit():
    def of(frames, preset="paper", memory=8.0):
        config = config_from_dict({"preset": preset, "sequence": {"memory": memory}})
        return estimated_cost(expected_frames(frames, config), 640, 512, config)

    small, large = of(60), of(120)
    assert large.sequence_bytes == pytest.approx(2 * small.sequence_bytes) and not large.file_bytes
    assert large.total_bytes - small.total_bytes == pytest.approx(60 * 640 * 512 * (9 + 0.17))
    long = of(2000, "sharp", 4.0)
    assert long.file_bytes == long.sequence_bytes == 2000 * 640 * 512 * 9
    assert long.total_bytes == pytest.approx(4e9 / 4 + 2000 * 640 * 512 * 0.17 + 0.6e9 + 8.7e3 * long.gaussians)
    assert of(60, "sharp").total_bytes > small.total_bytes


def test_a_budget_decides_gaussians_and_minutes():
    wide, narrow = (
        estimated_cost(SIXTY, 640, 512, config_from_dict({"preset": "quick", "density": {"maximum": n}}))
        for n in (60_000, 22_000)
    )
    assert (wide.gaussians, narrow.gaussians) == (60_000, 22_000)
    assert wide.minutes > 1.2 * narrow.minutes
    assert wide.total_bytes - narrow.total_bytes == pytest.approx(8.7e3 * 38_000)


def test_a_small_picture_gives_a_point_per_pixel():
    """Of 35 000 and 5000 requested points; the growth by the threshold starts from them."""
    assert at_start(PAPER).gaussians == at_start(PAPER, 640 * 512).gaussians == 40_000
    assert at_start(PAPER, 160 * 128).gaussians == 160 * 128 + 5000
    large, small = gaussians_at_end(PAPER, 640 * 512), gaussians_at_end(PAPER, 160 * 128)
    assert small / large == pytest.approx(25_480 / 40_000, rel=1e-4)


def test_the_work_that_is_left_adds_up():
    """0.57 of an iteration is for 60 000 Gaussians, 0.35 for 640x512 pixels; a coarse start sees a quarter of these,
    and the first third of a run takes less."""
    config = msgspec.structs.replace(
        PAPER, density=msgspec.structs.replace(PAPER.density, growth="budget", maximum=120_000)
    )
    full = 640 * 512
    assert work_left(config, full, Standing(5990, 60_000)) == pytest.approx(10 * 1.0)
    assert work_left(config, full, Standing(6000, 60_000)) == 0.0
    assert work_left(config, full, Standing(3990, 60_000, True)) == pytest.approx(
        work_left(config, full, Standing(3990, 60_000)) - 10 * 0.35 * 3 / 4
    )
    growing = work_left(config, full, Standing(2100, 60_000)) - work_left(config, full, Standing(4000, 120_000))
    assert growing == pytest.approx(1900 * (1 + 0.57 / 2), rel=1e-3)
    early = work_left(config, full, Standing(0, 120_000)) - work_left(config, full, Standing(2100, 120_000))
    assert early == pytest.approx(2100 * 1.57 * (0.77 + 1) / 2, rel=1e-3)


def test_a_clip_that_fits_nowhere_is_refused_before_reading(sequence, tmp_path, monkeypatch):
    write_endonerf(sequence, tmp_path / "clip")
    few = msgspec.structs.replace(PAPER, sequence=SequenceConfig(memory=1e-4))
    found = {f.code: f for f in check_sequence(tmp_path / "clip", few).findings}
    assert found["frames-in-file"].level == "note" and "disk" not in found
    monkeypatch.setattr("shutil.disk_usage", lambda place: SimpleNamespace(free=10))
    found = {f.code: f for f in check_sequence(tmp_path / "clip", few).findings}
    assert found["disk"].level == "refusal" and "use fewer --frames" in found["disk"].what
    with pytest.raises(InputError, match="use fewer --frames"):
        read_sequence(tmp_path / "clip", few.sequence, 0.2)


def test_too_little_memory_is_a_warning(sequence, tmp_path, monkeypatch):
    write_endonerf(sequence, tmp_path / "clip")
    monkeypatch.setattr("endotsr.clips.sequences.checks.check.memory_of_machine", lambda: 1e8)
    found = {f.code: f for f in check_sequence(tmp_path / "clip", PAPER).findings}
    assert found["memory"].level == "warning" and "this machine has 0.1 GB" in found["memory"].what


def test_the_command_writes_json_and_a_page(sequence, tmp_path, capsys):
    write_endonerf(sequence, tmp_path / "clip")
    files = [str(tmp_path / "a.json"), str(tmp_path / "a.html")]
    assert main(["check", str(tmp_path / "clip"), "--json", files[0], "--html", files[1]]) == 0
    assert "ready for training" in capsys.readouterr().out
    each(tmp_path / "clip", "images", lambda x: x * 0, [3])
    cut(tmp_path / "clip/masks/000002.png")
    assert main(["check", str(tmp_path / "clip"), "--json", files[0], "--html", files[1]]) == 1
    said = capsys.readouterr().out
    assert "warning: black-frame" in said and "refused" in said
    found = json.loads((tmp_path / "a.json").read_text())
    assert [f["code"] for f in found["findings"]][:1] == ["mask"] and found["facts"]["frames"] == FRAMES
    page = (tmp_path / "a.html").read_text()
    assert "black-frame" in page and "<script" not in page and "data:image" in page
    assert main(["check"]) == 2 and "SEQUENCE is missing" in capsys.readouterr().err
    assert main(["check", str(tmp_path / "nowhere")]) == 2


def test_a_folder_without_a_part_of_a_sequence_is_sent_to_prepare(tmp_path, capsys):
    clip = tmp_path / "clip"
    clip.mkdir()
    write_video(clip / "a.avi", np.zeros((3, 48, 64, 3), np.uint8))
    (clip / "calibration.yaml").write_text("%YAML:1.0\n")
    for words in (["check", str(clip)], ["train", str(clip), "--out", str(tmp_path / "run")]):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert f"it holds a.avi, which `endotsr prepare {clip / 'a.avi'} --out FOLDER` converts" in said
        assert said.count("\n") == 1 and len(said) < 600
    (clip / "images").mkdir()
    assert main(["check", str(clip)]) == 1 and "masks-files" in capsys.readouterr().out


@pytest.mark.parametrize("rate", [0.1, 1.0, 25.0, 59.94, 1000.0])
def test_the_rates_of_cameras_are_not_named(rate):
    assert rate_findings(np.arange(6) * (1 / rate), None, "here") == rate_findings(None, rate, "here") == []
    assert rate_findings(None, None, "here") == []


def test_a_broken_sequence_file_says_nothing_of_the_folders_beside_it(tmp_path, capsys):
    written(tmp_path)
    file = tmp_path / "sequence.toml"
    file.write_text(file.read_text().replace("fx =", "focal ="))
    assert main(["check", str(tmp_path)]) == 1
    said = capsys.readouterr().out
    assert "sequence-file" in said and "not-read" not in said


def test_a_size_that_the_pictures_do_not_have_is_an_error_of_the_file(tmp_path, capsys):
    written(tmp_path, masks=False, depth=False)
    for file in (tmp_path / "images").iterdir():
        write_png(file, read_png(file)[:20])
    main(["check", str(tmp_path)])
    said = capsys.readouterr().out
    assert "states 32x24, the pictures have 32x20; sequence.toml" in said and "correct the poses" not in said


@pytest.mark.data
def test_a_published_sequence_is_accepted(tmp_path):
    checked = check_sequence(first_frames("endonerf_pulling", 5, tmp_path), PAPER)
    assert not checked.refused, [f.line for f in checked.findings]
