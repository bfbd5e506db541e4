"""The yardstick of the judge: its mistakes fit the sources, cover every family, and a sample of them is named.

All of them: python tests/port/injected/inject.py
"""

import shutil
import tempfile
from pathlib import Path

import inject
import pytest

from endotsr.port.judge.store import golden_folder, read_golden
from makers.copies import changed_text
from makers.registry import FAMILIES, all_wrong_ports
from makers.wrong import wrong_ports

KNOWN = all_wrong_ports()
MISTAKES = {port: inject.mistakes(port) for port in inject.PORTS}


def test_every_mistake_fits_its_source():
    for port in ("c99", "torch"):
        for mistake in MISTAKES[port]:
            assert inject.changed(port, mistake)
    for mistake in MISTAKES["reference"]:
        for module in {one.module for one in mistake.edits}:
            assert changed_text(module, [one for one in mistake.edits if one.module == module])
        assert mistake.edits != KNOWN[mistake.flag].edits, f"{mistake.flag} is the wrong port itself"


def test_the_mistakes_are_many_known_and_of_every_family():
    flags = [m.flag for of in MISTAKES.values() for m in of]
    assert len(flags) >= 80 and set(flags) <= set(KNOWN)
    touched = {family for family in FAMILIES for w in wrong_ports(family) if w.flag in flags}
    assert touched == set(FAMILIES) - {"other_settings", "sides"}  # cases alone
    assert sum("training" in m.operations for m in MISTAKES["reference"]) >= 10


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which("cc") or shutil.which("gcc")), reason="no C compiler (cc or gcc) on this machine")
@pytest.mark.parametrize("flag", ["", "tanh_missing", "support_subsampled", "depth_over_opacity"])
def test_a_mistake_in_the_c_port_is_named_and_the_right_port_is_not(flag):
    golden = read_golden(golden_folder())
    with tempfile.TemporaryDirectory() as scratch:
        mistake = next((m for m in MISTAKES["c99"] if m.flag == flag), None)
        outcome = inject.said("c99", flag, inject.CPort(Path(scratch), golden).report(mistake))
    assert outcome.right if flag else outcome.named == () and outcome.refused == 0
