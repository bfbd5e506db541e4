"""Fixtures of all tests of ports: the golden cases, and what the reference answers; the port by hand importable."""

import functools
import sys
from pathlib import Path

import pytest

from endotsr.port.judge.store import golden_folder, read_golden
from endotsr.port.reference import answer_all

sys.path.append(str(Path(__file__).parent / "unseen" / "by_hand"))


@pytest.fixture(scope="session")
def golden():
    return read_golden(golden_folder())


@pytest.fixture(scope="session")
def reference_answers(golden, tmp_path_factory):
    """The folder of the outputs of the reference in a precision; a test that changes a file restores it."""

    @functools.cache
    def folder_of(precision):
        folder = tmp_path_factory.mktemp(precision)
        answer_all(golden, folder, precision)
        return folder

    return folder_of
