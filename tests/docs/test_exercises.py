"""The script of the exercises is a port of one function: the judge accepts it, and refuses it with a wrong sign."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = re.findall(r"^```python\n(.*?)^```$", (ROOT / "notebooks" / "index.md").read_text("utf-8"), re.M | re.S)[0]
SIGN = "d_loss * np.sign(difference)"


@pytest.mark.parametrize("text, accepted", [(SCRIPT, True), (SCRIPT.replace(SIGN, f"-{SIGN}"), False)])
def test_the_judge_reads_the_script_of_the_exercises(tmp_path, text, accepted):
    assert SIGN in SCRIPT
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    port = f'"{sys.executable}" "{tmp_path / "mine.py"}" {{requests}} {{outputs}}'
    command = [sys.executable, "-m", "endotsr", "golden", "run", "--only", "masked_l1", "--precision", "float64"]
    answer = subprocess.run([*command, "--port", port], capture_output=True, text=True, cwd=ROOT, check=False)
    assert (answer.returncode == 0) == accepted, answer.stdout + answer.stderr


@pytest.mark.parametrize("file", sorted((ROOT / "notebooks").glob("*.py")), ids=lambda file: file.stem)
def test_a_chapter_has_graded_exercises_of_which_the_golden_cases_judge_one(file):
    text = file.read_text("utf-8").split("\n# ## Exercise\n")[1].split("\n# %% jupyter")[0]
    assert re.findall(r"^# (\d)\. ", text, re.M) == ["1", "2", "3"]
    assert re.search(r"`--only \w+`", text), "or a line break stands inside the option"


@pytest.mark.parametrize("family", re.findall(r"`--only (\w+)`", "".join(
    file.read_text("utf-8") for file in sorted((ROOT / "notebooks").glob("*.py")))))  # fmt: skip
def test_an_exercise_names_a_family_of_cases(family):
    assert (ROOT / "golden" / "cases" / family).is_dir()
