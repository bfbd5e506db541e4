"""The helper for unittest: passed, failed, skipped and known cases."""

import unittest

from endotsr.port.judge.unittest_cases import golden_test_case


def port(wrong=False):
    def answer(operation, inputs, settings):
        if operation != "motion":
            return None
        c, phi, d = inputs["motion_coefficients"], inputs["phi"], inputs["d_translation"]
        return {
            "translation": (c * phi[:, None]).sum(axis=1) * (2 if wrong else 1),
            "d_motion_coefficients": d[:, None] * phi[:, None],
            "d_phi": (d[:, None] * c).sum(axis=(0, 2)),
        }

    return answer


def outcome(**words):
    result = unittest.TestResult()
    unittest.defaultTestLoader.loadTestsFromTestCase(golden_test_case(level=1, precision="float64", **words)).run(
        result
    )
    return result


def test_a_right_port_passes_and_the_rest_is_skipped():
    result = outcome(answer=port())
    assert result.wasSuccessful() and len(result.skipped) == result.testsRun - 2 > 50


def test_a_mistake_fails_with_its_name_and_a_known_failure_is_expected(tmp_path):
    result = outcome(answer=port(wrong=True))
    failed = {case.id().rpartition(".")[2]: text for case, text in result.failures}
    assert set(failed) == {"test_motion_generic", "test_motion_wide"}
    assert all("translation" in text for text in failed.values())
    listed = tmp_path / "known.txt"
    listed.write_text("motion/generic\n")
    assert len(outcome(answer=port(wrong=True), known_failures=listed).expectedFailures) == 1
    assert len(outcome(answer=port(), known_failures=listed).unexpectedSuccesses) == 1
