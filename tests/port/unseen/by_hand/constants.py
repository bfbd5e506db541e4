"""Which cases move each setting and each constant of the specification: golden/SETTINGS.md, made by

    python docs/make.py ports.settings

A row of the settings says, for each value, a case that refuses a port which always uses it. A row of the constants says
which cases refuse the port by hand with another value of it (`constants.toml`).
"""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[4] / "golden"))
import hand_port
from tqdm import tqdm

from endotsr.errors import InputError
from endotsr.port.judge.compare import judged
from endotsr.port.judge.store import golden_folder, read_golden
from makers import hard_coded

PAGE = golden_folder() / "SETTINGS.md"
HEAD = """# What moves in the cases

Made by `python docs/make.py ports.settings`; do not edit.

## Settings

Each setting takes at least two values in the cases. A port that always uses one of them is refused by the case beside
it.

| Setting | Value: a case that refuses a port which always uses it |
|---|---|
"""
MIDDLE = """
Not moved, with the reason:

| Setting | Reason |
|---|---|
"""
CONSTANTS = """
## Constants

Each constant of the specification has another value once (by a hundredth where nothing else is said), and these cases
refuse it.

| Constant | Equation | Cases that refuse another value |
|---|---|---|
"""


def constants() -> list[dict]:
    """The entries of `constants.toml`."""
    return tomllib.loads(Path(__file__).with_name("constants.toml").read_text(encoding="utf-8"))["constant"]


def refusing(golden, edits) -> list[str]:
    """Names of the cases that refuse the port by hand with these edits. Cases outside its operations are not asked."""
    port, found = hand_port.operations(edits), []
    for case in golden.cases:
        if case.operation not in hand_port.OPERATIONS:
            continue
        out = hand_port.answer(port, case.operation, golden.inputs(case), case.settings)
        answers = [{n: golden.array(case, o.answer(k)) for n, o in case.outputs.items()} for k in range(case.answers)]
        if not any(
            all(judged(out[n], one[n], o.compare, "float64").passed if out[n].shape == one[n].shape else False
                for n, o in case.outputs.items())
            for one in answers
        ):  # fmt: skip
            found.append(case.name)
    return found


def rows_of_constants(golden) -> list[tuple[str, str, str]]:
    """Name, equation and what refuses another value; a constant that nothing refuses and that is not free is a gap."""
    rows = []
    for entry in tqdm(constants(), "constants", leave=False, disable=None):
        if "free" in entry:
            rows.append((entry["name"], entry["equation"], f"none: {entry['free']}"))
            continue
        names = refusing(golden, entry["edit"])
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        rows.append((entry["name"], entry["equation"], ", ".join(f"`{name}`" for name in names[:3]) + more))
    return rows


def page(golden) -> str:
    """The page with both tables. Raises: InputError for a setting that the cases do not move and that is not free."""
    rows = hard_coded.table(golden._replace(cases=sorted(golden.cases, key=lambda case: case.level)))
    if faults := [row.fault for row in rows if row.fault]:
        raise InputError("\n".join(faults))
    moved = [
        (f"`{row.setting}`", ", ".join(f"{value}: `{case}`" for value, case in row.refused_by.items())) for row in rows
    ]
    free = [(f"`{name}`", reason) for name, reason in hard_coded.FREE.items()]
    lines = [
        HEAD,
        *(f"| {' | '.join(row)} |\n" for row in moved),
        MIDDLE,
        *(f"| {' | '.join(row)} |\n" for row in free),
        CONSTANTS,
        *(f"| {' | '.join(row)} |\n" for row in rows_of_constants(golden)),
    ]
    return "".join(lines)


def main() -> None:
    """The command; a fault leaves the page as it is."""
    try:
        text = page(read_golden(golden_folder()))
    except InputError as error:
        sys.exit(f"error: {error}")
    PAGE.write_text(text, encoding="utf-8", newline="\n")
    print(f"{PAGE} written")
