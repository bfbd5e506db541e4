"""Names from a file become the name of one file or nothing; text for a terminal holds no control character."""

import pickle
import re
from pathlib import Path

import pytest

from endotsr.errors import InputError
from endotsr.untrusted import names
from endotsr.untrusted.names import LONGEST_NAME, counted, file_name, plain_line, relative_path

GOOD = ["000000", "frame 1", "a-b_c.left", "Übersicht", "図1", "-rf", "x" * LONGEST_NAME, "console", "com"]
GOOD += [] if names.os.name == "nt" else ["12:30:05"]  # Windows allows no colon
BAD = {
    "../EVIL": "is a path",
    "/etc/passwd": "is a path",
    "a/b": "is a path",
    "a\\b": "is a path",
    "C:\\x": "is a path",
    "..": "begins with a dot",
    ".": "begins with a dot",
    ".hidden": "begins with a dot",
    "": "is empty",
    "a\0b": "control character",
    "a\nb": "control character",
    "\x1b[2J": "control character",
    "a\u202egnp": "control character",
    "\ud800": "control character",
    "x" * (LONGEST_NAME + 1): "has 201 bytes",
    "ü" * 101: "has 202 bytes",
    "name.": "ends with a dot",
    "name ": "ends with a dot or a space",
    "NUL": "device",
    "con.png": "device",
    "Com1": "device",
    "lpt9.x.y": "device",
}


@pytest.mark.parametrize("name", GOOD)
def test_ordinary_names_stay_as_they_are(name):
    assert file_name(name, "here") == name


@pytest.mark.parametrize("name", BAD, ids=ascii)
def test_anything_else_is_refused_in_one_line(name):
    with pytest.raises(InputError, match=BAD[name]) as caught:
        file_name(name, "run/sequence.json: names")
    said = str(caught.value)
    assert said.startswith("run/sequence.json: names: ") and said.isprintable()


@pytest.mark.parametrize("value", [3, None, ["a"], b"a", True])
def test_what_is_no_text_is_refused(value):
    with pytest.raises(InputError, match="not text"):
        file_name(value, "here")


@pytest.mark.parametrize("path", ["../a.npy", "a/../../b", "/a", "a//b", "a/", "a/./b", "a\\..\\b", 7])
def test_paths_that_leave_their_folder_are_refused(path):
    with pytest.raises(InputError):
        relative_path(path, "file")


def test_a_path_below_its_folder_stays_as_it_is():
    assert relative_path("inputs/colour.npy", "file") == "inputs/colour.npy"


def test_a_line_for_a_terminal_holds_no_control_character():
    assert plain_line("  two\n lines\t\x1b[31mred\u202e ") == "two lines \\u001b[31mred\\u202e"
    assert plain_line("Größe 図") == "Größe 図"


def test_no_message_of_unusable_input_can_move_the_cursor():
    error = InputError("a\x1b[2J.png: cannot be read\nsecond\u202eline")
    assert str(error) == "a\\u001b[2J.png: cannot be read\nsecond\\u202eline"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_count_has_its_plural_from_one_place():
    """Before, nine modules had their own, and some said `1 frames`."""
    assert [counted(n, "frame") for n in (0, 1, 2)] == ["0 frames", "1 frame", "2 frames"]
    own = re.compile(r"""\{['"]s['"] (\*|if) """)
    package = Path(names.__file__).parents[1]
    found = [path.name for path in package.rglob("*.py") if own.search(path.read_text(encoding="utf-8"))]
    assert found == ["names.py"]
