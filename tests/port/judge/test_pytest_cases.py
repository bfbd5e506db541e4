"""One pytest test per case for ports in Python: a right one, a wrong one, an unfinished one, and known failures."""

import textwrap

import numpy as np
import pytest
from made_up_ports import case_of

from endotsr.errors import InputError
from endotsr.port.judge.pytest_cases import answered, explain, golden_test, known_of


def answer(operation, inputs, settings):
    """A port of equation (3), in its own words."""
    if operation != "motion":
        return None
    c, phi, up = inputs["motion_coefficients"], inputs["phi"], inputs["d_translation"]
    return {
        "translation": np.tensordot(phi, c, axes=(0, 1)),
        "d_motion_coefficients": up[:, None, :] * phi[None, :, None],
        "d_phi": (c * up[:, None, :]).sum(axis=(0, 2)),
    }


def half(operation, inputs, settings):
    found = answer(operation, inputs, settings)
    return found and found | {"translation": found["translation"] / 2}


def test_a_wrong_port_is_explained(golden):
    case = case_of(golden, "motion/generic")
    report = answered(golden, case, half, "float32", 1)
    assert report is not None and report.status == "refused" and "translation" in explain(report)
    assert answered(golden, golden.cases[0], half, "float32", 1) is None


@pytest.mark.slow
def test_known_failures_are_strict(tmp_path):
    listed = tmp_path / "known.txt"
    listed.write_text("motion/generic  # a factor 2\nmotion/wide\n")
    for port, known, code in (("half", str(listed), 0), ("answer", str(listed), 1), ("answer", None, 0)):
        file = tmp_path / f"test_{port}_{known is None}.py"  # a module is imported once a process
        file.write_text(
            textwrap.dedent(f"""
            import sys
            sys.path.insert(0, {str(__file__.rsplit("/", 1)[0])!r})
            from test_pytest_cases import {port}
            from endotsr.port.judge.pytest_cases import golden_test
            test_port = golden_test({port}, level=1, known_failures={known!r})
            """)
        )
        found = pytest.main(["-q", "-p", "no:cacheprovider", "-p", "no:randomly", str(file)])
        assert found == code, (port, known)


def test_a_known_failure_that_is_no_case_is_refused(tmp_path):
    (tmp_path / "known.txt").write_text("motion/nothing\n")
    with pytest.raises(InputError, match="no such case"):
        golden_test(answer, known_failures=tmp_path / "known.txt")


def test_a_file_of_known_failures_that_is_no_text_is_refused(tmp_path):
    listed = tmp_path / "known.txt"
    listed.write_bytes("motion/generic  # dür Rest\n".encode("utf-16"))
    with pytest.raises(InputError, match=r"known\.txt: not UTF-8 text"):
        known_of(listed, {"motion/generic"})
