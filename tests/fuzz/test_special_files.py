"""Every reader of the fuzzing, given something that is no regular file, or a file that is damaged as a whole.

The commands of `tests/faults/test_every_reader.py` show the same from outside, for the files of a run and a sequence.
"""

import os

import pytest
from campaign_of_inputs import bounded_memory
from readers import READERS
from recordings import COLMAP_TEXT

from endotsr.clips.formats.colmap_model import read_model
from endotsr.errors import InputError
from special_files import DAMAGE, NO_FILES

pytestmark = [
    pytest.mark.fuzz,
    pytest.mark.timeout(10),  # a reader that waits for a pipe fails the test
    pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes"),
]
SEVERAL_FILES = ("COLMAP (text)", "COLMAP (binary)")  # the fuzzing unpacks these itself
MAY_BE_MISSING = ("log.jsonl",)
LOOKED_FOR = ("times of pictures",)  # what is no regular file is no list of times; `prepare` names it as not read


def refusal(reader, path):
    """The message of a reader that refuses; None if it reads the file."""
    try:
        with bounded_memory():
            reader.read(path)
    except reader.refuses as error:
        return str(error)
    return None


@pytest.mark.parametrize("fault", NO_FILES)
@pytest.mark.parametrize("name", [name for name in READERS if name not in (*SEVERAL_FILES, *LOOKED_FOR)])
def test_what_is_no_regular_file_is_refused_in_one_line(name, fault, tmp_path, capfd):
    reader = READERS[name]
    path = tmp_path / reader.name
    path.write_bytes(reader.seeds()[0])
    NO_FILES[fault](path)
    said = refusal(reader, path)
    if said is None and fault == "missing" and name in MAY_BE_MISSING:
        return
    assert said and "\n" not in said.strip()
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", READERS)
def test_damage_of_a_whole_file_is_read_or_refused_in_one_line(name, tmp_path, capfd):
    reader = READERS[name]
    for fault, damage in DAMAGE.items():
        path = tmp_path / reader.name
        path.write_bytes(reader.seeds()[-1])
        damage(path)
        said = refusal(reader, path)
        assert said is None or "\n" not in said.strip(), fault
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("fault", ["named pipe", "device", "huge"])
@pytest.mark.parametrize("name", ["cameras.txt", "images.txt", "points3D.txt"])
def test_every_file_of_a_colmap_model_is_a_regular_file(name, fault, tmp_path):
    for file, text in zip(("cameras.txt", "images.txt", "points3D.txt"), COLMAP_TEXT):
        (tmp_path / file).write_bytes(text)
    assert len(read_model(tmp_path).images) == 2
    NO_FILES[fault](tmp_path / name)
    with pytest.raises(InputError, match=name.split(".")[0]):
        read_model(tmp_path)
