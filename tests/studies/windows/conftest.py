"""The small recording, and a run of two windows on it that start cold; both are read only."""

import pytest
from small_recording import trained, write_recording


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    return write_recording(tmp_path_factory.mktemp("recordings") / "breathing")


@pytest.fixture(scope="session")
def cold_run(recording, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "cold"
    trained(recording, out)
    return out
