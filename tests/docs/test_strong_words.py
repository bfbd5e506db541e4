"""Every sentence with *because, only, never, every* and the like has a verdict, and a measured one a check."""

import json
import re
import tomllib

import pytest
import strong_words
from bare_figures import ROOT
from pages.full_size import levers
from strong_words import strong

TABLE = tomllib.loads(strong_words.TABLE.read_text(encoding="utf-8"))["files"]
KINDS = {"rule", "maths", "reason", "record", "run", "source", "hedged", "question", "wording"}
CHECKED = sorted({check for of in TABLE.values() for kind in ("record", "run") for check in of.get(kind, {}).values()})
RESULTS = ROOT / "docs" / "results"


def test_every_strong_word_has_a_verdict():
    """The message has the lines for strong_words.toml; read the sentence before you add one."""
    found = [f"{one.file}:{one.line}: {one.key!r} in: {one.sentence}" for one in strong_words.without_verdict()]
    assert not found, "give each a verdict, with the run that shows it, or reword it: python tests/docs/strong_words.py"


def test_every_verdict_has_its_sentence():
    assert strong_words.without_word() == [], "remove these lines from strong_words.toml"


def test_verdicts_are_of_the_listed_kinds():
    assert {kind for of in TABLE.values() for kind in of} <= KINDS
    measured = [of[kind] for of in TABLE.values() for kind in ("record", "run") if kind in of]
    assert measured and all(isinstance(listed, dict) for listed in measured), "a measured statement names its check"


@pytest.mark.parametrize("check", CHECKED)
def test_the_check_of_a_measured_statement_exists(check):
    path, _, name = check.partition("::" if "::" in check else " | ")
    assert (ROOT / path).is_file()
    text = (ROOT / path).read_text(encoding="utf-8")
    assert name in text if "::" not in check else re.search(rf"^def {re.escape(name)}\(", text, re.MULTILINE)


@pytest.mark.parametrize(
    "sentence, words",
    [
        ("It is slow because the cache is small.", "it is slow because the cache is"),
        ("A **never**\nfails here, and `never` in code is none.", "a never fails here and"),
        ("No method is right to the last bit.", "no method is right to the last"),
    ],
)
def test_a_planted_sentence_has_no_verdict_and_is_named_with_its_line(sentence, words):
    (found,) = strong(f"# Title\n\nFirst. {sentence}\n\nLast so that it ends, every 50th time.\n", "docs/a.md")
    assert (found.line, found.key) == (3, words) and ("docs/a.md", found.key) not in strong_words.known()


def gains(record: str, split: str, with_: str, without: str) -> list[float]:
    """PSNR of one configuration minus that of another, by seed, dB."""
    rows = json.loads((RESULTS / f"{record}.json").read_text(encoding="utf-8"))["rows"]
    of = {(row["split"], row["configuration"], row["seed"]): row["psnr_full"] for row in rows}
    seeds = sorted({seed for _, _, seed in of})
    return [of[split, with_, seed] - of[split, without, seed] for seed in seeds]


def test_what_gains_in_every_seed():
    for found in (
        gains("ablation_simulated_paper", "every_eighth", "A+S+L", "A+S"),
        gains("ablation_simulated_paper", "every_eighth", "L", "base"),
        gains("ablation_pulling_half", "every_second", "A+S+L", "base"),
        gains("ablation_pulling_half_blocks", "blocks 2", "A+S+L", "base"),
        gains("ablation_pulling_half_fixed", "every_eighth", "A+S+L fixed", "A+S fixed"),
        gains("ablation_pulling_half_fixed", "every_eighth", "A+S+L", "A+S"),
    ):
        assert len(found) == 3 and min(found) > 0


def test_what_improves_every_scene():
    """In every seed too: targets between the frames, these targets against those at rest, and the weight of SSIM."""
    scenes = levers.PROGRAM.read()["scenes"]
    psnr = {scene: {k: [run["psnr_tissue"] for run in runs] for k, runs in of.items()} for scene, of in scenes.items()}
    for without in ("no targets between the frames", "these targets at rest", "`ssim_weight` of `paper`"):
        for of in psnr.values():
            assert all(a > b for a, b in zip(of["`sharp`"], of[without], strict=True))
