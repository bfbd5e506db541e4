"""The grammar of the command line, and the help page that describes it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from endotsr.cli.parts.commands import COMMANDS
from endotsr.cli.parts.completion import options_of
from endotsr.cli.parts.fields import REQUIRED, Option, fields_of
from endotsr.cli.parts.help_page import help_page
from endotsr.cli.parts.mistakes import option_names
from endotsr.cli.parts.parser import converted, parse, parse_known
from endotsr.cli.simulate import SimulateOptions
from endotsr.cli.train import TrainOptions
from endotsr.config import PAPER, Config
from endotsr.errors import InputError
from endotsr.untrusted.sections import NonNegative


@dataclass
class Base:
    """Never shown."""

    level: Literal[0, 5] = 5
    """how far"""


@dataclass
class Options(Base):
    """What is tried here.

    A second paragraph.
    """

    first: Annotated[str, Option("FIRST", positional=True)] = ""
    """one word"""
    rest: Annotated[tuple[Path, ...], Option("[REST ...]", positional=True)] = ()
    """other words"""
    offset: float = 0.0
    """may be negative"""
    sizes: tuple[int, ...] = (1, 2)
    """several numbers"""
    places: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """three numbers"""
    marks: Annotated[tuple[int, ...], Option("INT ...", may_be_empty=True)] = (3,)
    """numbers or none"""
    fast: bool = False
    """a switch"""
    out: Path | None = None
    """a file"""
    settings: Annotated[Config, Option(flat=True)] = PAPER


def tried(*words: str) -> Options:
    return parse(Options, list(words), "try")


def test_options_and_positional_arguments_may_be_mixed():
    found = tried("--offset", "2", "a", "--fast", "b", "--out=x=y", "c", "--level", "0")
    assert (found.first, found.rest) == ("a", (Path("b"), Path("c")))
    assert (found.offset, found.fast, found.out, found.level) == (2.0, True, Path("x=y"), 0)


@pytest.mark.parametrize("word", ["-3e-05", "-1.5E+2", "-5.", "-1", "-.5", "-0.25"])
def test_a_negative_number_is_one_of_several_values(word):
    found = tried("--sequence.depth-percentiles", "1", "99", "--places", "1", word, "2e-3", "a")
    assert found.places == (1.0, float(word), 2e-3) and found.first == "a"


@pytest.mark.parametrize(("words", "fast"), [(["--no-fast=true"], False), (["--no-fast=false"], True)])
def test_a_negated_switch_takes_a_word(words, fast):
    assert tried("--fast", *words).fast is fast
    with pytest.raises(InputError, match="--fast 'maybe' is not allowed; use true or false"):
        tried("--no-fast=maybe")


def test_without_words_the_defaults_stand():
    assert tried() == Options()
    assert tried("--fast", "--no-fast").fast is False  # the last one counts


@pytest.mark.parametrize("word", ["-1", "-1e-3", "-.5", "-inf"])
def test_a_negative_number_is_a_value(word):
    assert tried("--offset", word).offset == tried(f"--offset={word}").offset == float(word)


def test_frames_from_the_end_are_a_value():
    for word in ("-5:", "-5:-1", "-9::2", "-5,-2:"):
        assert tried("--sequence.frames", word).settings.sequence.frames == word
    assert tried("--out", "-5").out == Path("-5")
    with pytest.raises(InputError, match=r"--sequence\.frames: missing value TEXT"):
        tried("--sequence.frames", "-x")


def test_several_values_and_none():
    assert tried("--sizes", "3", "4", "5").sizes == (3, 4, 5)
    with pytest.raises(InputError, match="--sizes: missing value"):
        tried("--sizes")
    assert tried("--sizes", "3", "4", "--sizes", "5").sizes == (3, 4, 5), "given in parts"
    assert tried("--places", "1", "2", "3", "--places", "4", "5", "6").places == (4.0, 5.0, 6.0), "the last one counts"
    assert tried("--marks").marks == () and tried("--marks", "7").marks == (7,)
    assert tried("--sequence.depth-percentiles", "1", "99").settings.sequence.depth_percentiles == (1.0, 99.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--out",), "--out: missing value PATH"),
        (("--sequence.depth-percentiles", "1"), "--sequence.depth-percentiles: missing value FLOAT FLOAT"),
        (("--sizes", "3", "x"), "--sizes 'x' is not allowed; use an integer"),
        (("--sizes", "1k"), "--sizes '1k' is not allowed; use an integer, written out (1000)"),
        (("--sizes", "1.5M"), "--sizes '1.5M' is not allowed; use an integer, written out (1500000)"),
        (("--level", "3"), "--level '3' is not allowed; use 0 or 5"),
        (("--level", "3k"), "--level '3k' is not allowed; use 0 or 5"),
        (("--fast=maybe",), "--fast 'maybe' is not allowed; use true or false"),
        (("--offset", "low"), "--offset 'low' is not allowed; use a number"),
        (("-o", "x"), "-o: no such option; did you mean --out?"),
        (("--model.beta.x", "1"), "--model.beta.x: no such option; did you mean --model.beta?"),
        (("--model.base", "1"), "command line: unknown key model.base; use one of appearance"),
        (("--odd.beta", "1"), "command line: unknown key odd; use one of sequence, model, raster"),
    ],
)
def test_a_mistake_is_named_with_what_is_allowed(words, said):
    with pytest.raises(InputError) as refusal:
        tried(*words)
    found = str(refusal.value)
    assert ("; did you mean bases?" in found) == (words[0] == "--model.base")
    assert found.startswith(said) and ("written out" in found) == ("written out" in said)


@pytest.mark.parametrize("command", [name for name in COMMANDS if options_of(name)])
def test_the_help_shows_where_several_values_can_stand(command):
    for field in fields_of(options_of(command)):
        shown = field.name if field.positional else field.metavar
        counted = {"FX FY CX CY", "X Y WIDTH HEIGHT"}  # as many values as they name, which the command checks
        assert (field.count == "*") == (" ..." in shown or shown in counted), field.name


def test_known_options_are_picked_out_of_others():
    assert parse_known(Base, ["word", "--other", "x", "--level", "0", "--more=1"]).level == 0


def test_a_word_is_converted_by_the_first_type_that_takes_it():
    kind = NonNegative | Literal["auto"]
    assert converted(kind, "0.5") == 0.5 and converted(kind, "auto") == "auto"
    with pytest.raises(ValueError):
        converted(kind, "much")
    assert converted(Path | None, "None") == Path("None")  # a word is never the absence of one


@pytest.mark.parametrize("width", [60, 80, 100, 120])
def test_help_shows_every_option_with_its_text_in_the_width_of_the_terminal(width):
    fields = fields_of(TrainOptions, TrainOptions())
    page = help_page(TrainOptions, fields, "train", width)
    flat = " ".join(page.split())
    assert len(fields) > 90
    for field in fields:
        assert field.help, field.name
        assert " ".join(field.help.split()) in flat, field.name
        section, dot, key = field.name.rpartition(".")
        shown = field.name if not field.switch else f"{section}{dot}[no-]{key}" if dot else f"--[no-]{key[2:]}"
        assert f"\n  {shown}" in page, field.name
    names = {field.name for field in fields if len(field.name) + len(field.metavar) + 3 > width}
    long = [line for line in page.splitlines() if len(line) > width and not any(name in line for name in names)]
    assert not long


def test_help_names_sections_limits_and_defaults():
    page = help_page(TrainOptions, fields_of(TrainOptions, TrainOptions()), "train", 120)
    assert "\nmodel: Components and sizes of the model." in page
    assert "(a number > 0; default: 0.3)" in page
    assert "(default: true)" in page
    assert page.startswith("usage: endotsr train SEQUENCE [OPTIONS]\n")
    page = help_page(SimulateOptions, fields_of(SimulateOptions, SimulateOptions()), "simulate", 120)
    assert "\nnoise: Sensor noise in the picture.\n" in page


def test_a_missing_option_is_required_in_usage_help_and_error():
    @dataclass
    class Needs:
        """Needs one."""

        out: Annotated[Path, Option("DIR")]

    assert fields_of(Needs)[0].default is REQUIRED
    page = help_page(Needs, fields_of(Needs), "need", 80)
    assert "usage: endotsr need --out DIR [OPTIONS]" in page and "(required)" in page
    with pytest.raises(InputError, match="need: missing: --out DIR"):
        parse(Needs, [], "need")


def test_switches_have_two_names_and_all_options_are_listed():
    names = option_names(fields_of(Options))
    assert names[:4] == ["--help", "--level", "--offset", "--sizes"]
    assert {"--fast", "--no-fast", "--model.appearance", "--model.no-appearance"} <= set(names)
