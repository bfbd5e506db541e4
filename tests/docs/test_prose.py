"""Sentences that a technical editor rewrote do not come back."""

from pathlib import Path

import pytest
from pages.book.definitions import BLOCK

ROOT = Path(__file__).parents[2]
PAGES = [
    *ROOT.glob("*.md"),
    *(ROOT / "docs").rglob("*.md"),
    *(ROOT / "notebooks").glob("*.py"),
    *(ROOT / "notebooks").glob("*.md"),
]
TEXT = {
    file: " ".join(BLOCK.sub("", file.read_text("utf-8")).replace("\n# ", "\n").split()).lower()
    for file in PAGES
    if "_build" not in file.parts and file.parent.name != "_static"
}
REWRITTEN = """
the functions of the part do not exist
rests in the picture, and draws
what it misses by
count neither way
counts neither way
set no threshold
a third to all
leaves out 0
where the interval decides at all
moves nothing of use
goes the whole way
what the files do not say
what the way costs
measured are these
nothing fixes their product's parts
what a clip leaves open
refuses to be given
what each part that can be switched off
a coefficient means the same
makes the atoms
two minus signs meet
almost nothing at first
states which motion is unlikely
goes backwards through
colour and depth are wanted
no longer make up for it
depends on this rule is
which point a pixel shows
are the inside
would abuse
named after the mistake
is not equal to it in both
whatever is on
survives a kill
the data visits them
what stands there is made up
the form with sum and difference
1.000 to 1.000 times
gradient by
gradients by
constants of the derivative
constant of the derivative
constant of training
derivative by
float32 ends and
the rest of the house
the trainings
a training repeats
a training prints
zero by accident
one word for each thing
a radix sort does not
right values are on the wrong
up to permuting its axes
step uses the moment after
is not examined here* means
first form of this target
smaller differences are noise
seen with 80 %
""".split("\n")[1:-1]


@pytest.mark.parametrize("words", REWRITTEN)
def test_no_page_has_the_sentence(words):
    found = [str(file.relative_to(ROOT)) for file, text in TEXT.items() if words in text]
    assert not found
