"""Write golden/SETTINGS.md: which cases move each setting and each constant of the specification. Minutes.

python docs/make.py ports.settings

The tables come from the port by hand in tests/port/unseen/by_hand, with another value of each constant.
"""

import sys

from pages.store.program import DOCS


def main(words: list[str]) -> None:
    """The command; it has no words."""
    if words:
        sys.exit(__doc__)
    sys.path.insert(0, str(DOCS.parent / "tests" / "port" / "unseen" / "by_hand"))
    import constants  # pyright: ignore[reportMissingImports]

    constants.main()
