"""Numbers of the book stay on the line of their unit."""

import pytest

pytest.importorskip("sphinx", reason="Sphinx, which builds the book, is not installed (pip install '.[docs]')")
from unbroken_units import unbroken  # pyright: ignore[reportMissingImports]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("takes 12 ms a frame", "takes 12\u00a0ms a frame"),
        ("41.13 dB, 52.6 GB/s and 87.9 %.", "41.13\u00a0dB, 52.6\u00a0GB/s and 87.9\u00a0%."),
        ("1 462 338 visits of 60 000", "1\u202f462\u202f338 visits of 60\u202f000"),
        ("2 messages, 4 hours, 3 samples", "2 messages, 4 hours, 3 samples"),
        ("frames 12 15 and 2026 123456", "frames 12 15 and 2026 123456"),
        ("stop 1e-4, 9.7e-10 and a-1", "stop 1e-\u20604, 9.7e-\u206010 and a-1"),
        ("640x512 px", "640x512\u00a0px"),
    ],
)
def test_spaces_before_units_do_not_break(text, expected):
    assert unbroken(text) == expected
