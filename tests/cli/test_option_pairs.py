"""No option is without effect in silence: every pair of options of a command changes the outcome, or is refused.

`related_options` declares which options exclude or need one another. Here each option is tried alone and beside every
other one: where an option changes the outcome alone but not beside another, the pair must be refused, or a printed line
must name the option.
"""

import contextlib
import hashlib
import importlib
import inspect
import io
import itertools
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from made_videos import CAMERA, HEIGHT, WIDTH, picture, write
from raw_sources import colmap

from endotsr.cli.depth import DepthOptions
from endotsr.cli.export import ExportOptions
from endotsr.cli.main import main
from endotsr.cli.parts.comparison import EvaluateOptions
from endotsr.cli.parts.fields import fields_of
from endotsr.cli.parts.options import base_settings
from endotsr.cli.parts.parser import given_names, parse
from endotsr.cli.parts.related_options import EVALUATE, RELATIONS
from endotsr.cli.parts.relations import Needs, check_relations
from endotsr.cli.prepare import PrepareOptions
from endotsr.cli.render import RenderOptions
from endotsr.cli.train import TrainOptions
from endotsr.clips.opencv.png import write_png
from endotsr.errors import InputError

FRAMES = 6
# Options that only permit something: without an occasion they change nothing.
PERMISSIONS = {"prepare": ("replace", "trust-depth", "gaps"), "depth": ("replace", "trust-depth")}


class Outcome(NamedTuple):
    """What a command did."""

    code: int
    files: str  # hash of every file that it wrote
    said: str  # everything printed


def outcome(words: list[str], out: Path, before: Path | None = None) -> Outcome:
    """Run a command that writes to `out`, which is removed before, or replaced by a copy of the folder `before`."""
    if out.is_dir():
        shutil.rmtree(out)
    out.unlink(missing_ok=True)
    if before is not None:
        shutil.copytree(before, out)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = main(words)
    files = sorted(out.rglob("*")) if out.is_dir() else [out] if out.exists() else []
    digest = hashlib.sha256()
    for file in (file for file in files if file.is_file()):
        digest.update(file.relative_to(out.parent).as_posix().encode() + file.read_bytes())
    return Outcome(code, digest.hexdigest(), printed.getvalue())


def silent(
    base: list[str],
    options: dict[str, list[str]],
    out: Path,
    permitted: tuple[str, ...] = (),
    before: Path | None = None,
    pairs: bool = True,
) -> list[str]:
    """The options that are without effect in silence, alone or beside another one.

    permitted   options that only permit something
    before      the folder that the command changes, see `outcome`
    pairs       whether two of `options` stand beside one another, and not each beside those of `base` alone
    """
    nothing = outcome(base, out, before)
    assert nothing.code == 0, nothing.said
    alone = {name: outcome([*base, *words], out, before) for name, words in options.items()}
    found = [name for name, it in alone.items() if it.files == nothing.files and not _told(name, it)]
    read = [name for name in options if "does not read" not in alone[name].said]  # a layout refuses it in every pair
    for a, b in itertools.combinations(read, 2) if pairs else ():
        both = outcome([*base, *options[a], *options[b]], out, before)
        for one, other in ((a, b), (b, a)):
            if both.files == alone[other].files and not _told(one, both) and alone[one].files != nothing.files:
                found.append(f"{one} beside {other}")
    return [line for line in found if line.split()[0] not in permitted]


def _told(name: str, it: Outcome) -> bool:
    return it.code != 0 or f"--{name} " in it.said


def made(folder: Path) -> dict[str, Path]:
    """Sources and files for the options of `prepare`."""
    found = {}
    for name, shift in (("left", 0), ("right", 5)):
        (folder / "pair" / name).mkdir(parents=True)
        for i in range(FRAMES):
            write_png(folder / "pair" / name / f"{i:04d}.png", np.roll(picture(i), -shift, axis=1))
    for name in ("mask", "more", "depth"):
        (folder / name).mkdir()
    rng = np.random.default_rng(0)
    for i in range(FRAMES):
        for k, name in enumerate(("mask", "more")):
            plane = np.zeros((HEIGHT, WIDTH), np.uint8)
            plane[:20, 30 * k + i : 30 * k + 30] = 255
            write_png(folder / name / f"{i:04d}.png", plane)
        x = np.arange(WIDTH)[None] + np.arange(HEIGHT)[:, None]
        write_png(folder / "depth" / f"{i:04d}.png", (4000 + 9 * x + rng.integers(0, 9, x.shape)).astype(np.uint16))
    lines = [f"{i} {0.001 * i:.4f} {0.002 * i:.4f} 0 0 0 0.0871557 0.9961947" for i in range(FRAMES)]
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    (folder / "K.txt").write_text("100 0 63 0 101 46 0 0 1")
    write(folder / "a.mkv", [picture(i) for i in range(FRAMES)])
    write(folder / "right.mkv", [np.roll(picture(i), -5, axis=1) for i in range(FRAMES)])
    colmap(folder / "colmap", binary=False, frames=FRAMES)
    found |= {name: folder / name for name in ("pair", "mask", "more", "depth", "colmap")}
    return found


def prepare_options(folder: Path) -> dict[str, list[str]]:
    """One value of every option of `prepare` that differs from its default, as words."""
    values = {
        "stereo": ["none"], "camera": list(CAMERA[1:]), "field-of-view": ["65"],
        "distortion": ["-0.2", "0.05", "0", "0"],
        "calibration": [str(folder / "K.txt")], "baseline": ["4"], "trajectory": [str(folder / "poses.txt")],
        "trajectory-direction": ["world_to_camera"], "trajectory-axes": ["opengl"], "trajectory-unit": ["cm"],
        "masks": [str(folder / "mask")], "excluded-value": ["black"], "pairing": ["order"],
        "depth": [str(folder / "depth")],
        "depth-unit": ["um"], "depth-scale": ["0.02"], "trust-depth": [], "points": ["sparse"], "frames": ["0:5"],
        "drop": ["2"], "crop": ["8", "8", "32", "32"], "unite-masks": [str(folder / "more")], "rate": ["12"],
        "source-rate": ["50"], "orientation": ["stored"], "scale": ["0.5"], "gaps": ["drop"],
        "border": ["keep"], "pictures": ["jpg"], "also": ["nerfstudio"], "layout": ["auto"],
        "model": ["sparse/0"], "right": [str(folder / "right.mkv")], "right-late": ["-1"],
        "masks-late": ["1"],
    }  # fmt: skip
    return {name: [f"--{name}", *words] for name, words in values.items()}


def test_every_option_of_prepare_is_tried(tmp_path):
    assert _names(PrepareOptions) - set(prepare_options(tmp_path)) == {"out", "json", "replace"}


def _names(options: type) -> set[str]:
    return {field.name.removeprefix("--") for field in fields_of(options) if not field.positional}


@pytest.mark.parametrize(("source", "stated", "left_out", "pairs"), [
    ("pair", "camera", ["calibration", "field-of-view"], True),
    ("pair", "calibration", ["camera", "field-of-view", "distortion"], False),  # their pairs are those beside a camera
    ("a.mkv", "field-of-view", ["calibration", "camera"], True),
    ("colmap", None, [], True),
])  # fmt: skip
def test_no_pair_of_options_of_prepare_is_silent(source, stated, left_out, pairs, tmp_path):
    """Without an option that excludes the one on which the source depends: that pair is in the relations."""
    made(tmp_path)
    options, out = prepare_options(tmp_path), tmp_path / "o"
    base = ["prepare", str(tmp_path / source), "--out", str(out), *(options.pop(stated) if stated else [])]
    for name in (*left_out, "stereo", "layout"):  # the values of the last two are the defaults of these sources
        options.pop(name, None)
    assert silent(base, options, out, PERMISSIONS["prepare"], pairs=pairs) == []


def test_no_pair_of_options_of_depth_is_silent(tmp_path):
    """On a stereo clip, and on files of another program for a clip from one camera."""
    made(tmp_path)
    values = {
        "given": [str(tmp_path / "depth")], "kind": ["depth"], "pairing": ["order"],
        "align": ["frame"], "farthest-over-nearest": ["5"],
        "trust-depth": [], "flat": [], "unit-scale": ["0.01"], "nearest": ["30"], "farthest": ["100"], "block": ["9"],
        "no-smooth": [], "agreement": ["0.1"], "confidence": ["0.99"], "temporal": [],
    }  # fmt: skip
    options = {name: [f"--{name}", *words] for name, words in values.items()}
    assert _names(DepthOptions) - {*options, "smooth"} == {"replace", "json"}
    clip, one = tmp_path / "clip", tmp_path / "one"
    assert main(["prepare", str(tmp_path / "pair"), "--out", str(clip), *CAMERA, "--baseline", "4"]) == 0
    out = tmp_path / "out"
    assert silent(["depth", str(out)], options, out, PERMISSIONS["depth"], clip) == []
    assert main(["prepare", str(tmp_path / "a.mkv"), "--out", str(one), *CAMERA]) == 0
    base = ["depth", str(out), *options.pop("given"), "--kind", "relative"]
    options.pop("kind")
    assert silent(base, options, out, PERMISSIONS["depth"], one) == []


def test_no_pair_of_options_of_render_is_silent(finished_run, tmp_path):
    values = {
        "times": ["0.1", "0.5"], "frames": ["train"], "count": ["3"], "camera": ["orbit"], "angle": ["30"],
        "offset": ["1", "0", "0"], "size": ["40x40"], "depth": ["normalised"], "panels": ["render", "depth"],
        "rate": ["5"], "slow": ["2"], "npy": [], "texture": [], "without": ["appearance"], "sequence": ["elsewhere"],
    }  # fmt: skip
    options = {name: [f"--{name}", *words] for name, words in values.items()}
    assert _names(RenderOptions) - set(options) == {"out", "film", "json", "threads", "replace"}
    for name in ("pictures", "film.gif"):
        to = ["--film" if name == "film.gif" else "--out", str(tmp_path / name)]
        assert silent(["render", str(finished_run), *to], options, tmp_path / name) == []


def test_no_pair_of_options_of_export_is_silent(finished_run, tmp_path):
    values = {
        "content": ["points"], "times": ["0.1"], "frames": ["train"], "count": ["2"], "opacity": ["0.6"],
        "voxel": ["9"], "without": ["appearance"], "keys": ["3"], "title": ["mine"], "no-held-out": [],
        "sequence": ["elsewhere"],
    }  # fmt: skip
    options = {name: [f"--{name}", *words] for name, words in values.items()}
    assert _names(ExportOptions) - {*options, "held-out"} == {"out", "json", "threads", "replace"}
    for name in ("a.ply", "folder", "a.npz", "a.glb", "page.html"):
        assert silent(["export", str(finished_run), "--out", str(tmp_path / name)], options, tmp_path / name) == [], (
            name
        )


def test_terms_of_several_values_and_of_a_section():
    """`evaluate` alone has them."""

    def refused(*words: str, run: str = "of one training") -> str:
        line = [*words]
        try:
            given = given_names(EvaluateOptions, line)
            check_relations("evaluate", EVALUATE, parse(EvaluateOptions, line, "evaluate"), given, {"run": run})
        except InputError as error:
            return str(error)
        return ""

    assert "--no-view has no effect with several methods: no view.html" in refused("a", "b", "--no-view")
    assert "--no-view has no effect with the run of windows" in refused("a", "--no-view", run="of windows")
    assert "--measures has no effect with the run of windows" in refused("a", "--measures", "depth", run="of windows")
    assert "--no-view with --pictures" in refused("a", "--pictures", "b", "--no-view")
    assert "--sequence.* has no effect with methods" in refused("a", "--sequence.scale", "0.5")
    assert "--compare has no effect without methods" in refused("--compare")
    for allowed in (["a", "--no-view"], ["a", "b", "--seed", "1"], ["a", "b", "--sequence.scale", "0.5"]):
        assert refused(*allowed) == ""
    assert refused("--pictures", "b", "--sequence", "c", "--sequence.scale", "0.5", "--label", "mine") == ""


@pytest.mark.parametrize("command", ["evaluate", "masks", "tradeoff"])
def test_the_refusals_of_options_without_effect_stand_in_the_table(command):
    text = Path(inspect.getfile(importlib.import_module(f"endotsr.cli.{command}"))).read_text(encoding="utf-8")
    assert "has no effect" not in text and "needs --" not in text and f"{command}: --no-" not in text
    assert command in RELATIONS


# Options of `train` without a relation, and why they count in every combination that is accepted.
INDEPENDENT = {
    "out": "the run",
    "json": "the result",
    "preset": "the settings start from it; a run that exists names what it would change",
}


def test_every_option_of_train_is_related_or_independent():
    own = {name for name in _names(TrainOptions) if "." not in name} - {"scale", "frames", "masks", "seed", "threads"}
    related = {
        term.split("=")[0].removeprefix("no-")
        for relation in RELATIONS["train"]
        for term in (*relation[0], *relation[1])
    }
    assert own - related - set(INDEPENDENT) == set()


VALUES = {
    "calibrate-only": [], "config": ["mine.toml"], "preset": ["sharp"], "iterations": ["30"], "minutes": ["2"],
    "schedule": ["absolute"], "effects": ["auto"], "windows": ["9"], "resume": [], "no-evaluate": [], "lpips": ["a"],
    "overlap": ["3"], "chain": ["2"], "workers": ["1"], "scheduler": ["tcp://a:1"], "json": ["a.json"],
    "training.iterations": ["30"], "training.visits-per-frame": ["9"], "density.growth": ["budget"],
    "density.maximum": ["90"], "density.gradient-threshold": ["0.1"], "initialisation.first-frame-points": ["9"],
    "initialisation.other-frame-points": ["9"],
}  # fmt: skip


def _train(*words: str) -> None:
    line = ["sequence", "--out", "run", *words]
    parse(TrainOptions, line, "train", TrainOptions(settings=base_settings(line)[0]))


def _words(term: str) -> list[str]:
    """A term as words."""
    name, _, value = term.partition("=")
    return [f"--{name}", *([value] if value else VALUES.get(name, []))]


def test_the_relations_of_train_refuse(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    for relation in (relation for relation in RELATIONS["train"] if not relation.unless):
        for first in relation.first:
            if isinstance(relation, Needs):
                with pytest.raises(InputError, match=f"--{first} has no effect without"):
                    _train(*_words(first))
                continue
            for second in relation.second:
                needed = ["--windows", "9"] if {first, second} & {"overlap", "chain", "workers"} else []
                with pytest.raises(InputError, match=r"use one of them|has no effect without"):
                    _train(*_words(first), *_words(second), *needed)


def _settings() -> list[tuple[str, str]]:
    """Every setting of the relations, and the term that switches it off."""
    off = {
        "model.harmonics-degree": "model.harmonics-degree=0", "loss.smoothness-weight": "loss.smoothness-weight=0",
        "initialisation.other-frame-points": "initialisation.other-frame-points=0",
        "density.growth=threshold": "density.growth=budget", "loss.lambda-lap=auto": "loss.lambda-lap=0.5",
        "sequence.split=blocks": "sequence.split=every_eighth",
    }  # fmt: skip
    found = []
    for relation in (relation for relation in RELATIONS["train"] if relation.unless):
        for first in relation.first:
            if isinstance(relation, Needs):
                terms = [term for term in relation.second if term != "sequence.split=end"]
                switched = [off.get(term, term.replace(".", ".no-", 1)) for term in terms]
            else:
                switched = list(relation.second)
            found.append((first, " ".join(switched)))
    return found


@pytest.mark.parametrize(("name", "off"), _settings())
def test_a_setting_that_another_one_switches_off_is_refused(name, off):
    fields = {field.name.removeprefix("--"): field for field in fields_of(TrainOptions)}
    field = fields.get(name) or fields[name.replace("no-", "")]
    words = [] if field.switch else [str(field.default)]
    switched = [word for term in off.split() for word in _words(term)]
    with pytest.raises(InputError, match=f"--{name} (has no effect|with)"):
        _train(f"--{name}", *words, *switched)
