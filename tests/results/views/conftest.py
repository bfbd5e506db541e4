"""A browser for the tests of a file."""

import pytest
from browser import browser
from remote import Remote


@pytest.fixture(scope="module")
def remote(tmp_path_factory):
    browser()
    with Remote(tmp_path_factory.mktemp("profile")) as found:
        yield found
