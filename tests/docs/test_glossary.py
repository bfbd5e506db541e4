"""The glossary: every name of its tables exists, and no identifier of the package uses a word that it replaced."""

import ast
import inspect
import json
import re
from importlib import import_module
from pathlib import Path
from typing import Any

import msgspec
import pytest

import house
from endotsr.config import (
    Config,
)
from endotsr.training.fitting.records import LogEntry

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "reference" / "endotsr"
GLOSSARY = ROOT / "docs" / "glossary.md"
HEADER = ["Symbol", "Meaning", "Code", "Setting", "Log", "Golden"]
QUOTED = re.compile(r"`([^`]+)`")

# Words that the glossary replaced, and what to write instead. A word counts where an identifier is split at `_`.
FORBIDDEN_WORDS = {
    "detail": "laplacian (equation 5)",
    "share": "fraction, or parallel_for for threads",
    "shares": "fractions",
    "born": "activated",
    "birth": "activation",
    "conformance": "golden",
}
# Words that mean one thing, and the rooms that have it. Elsewhere the thing has another name.
RESERVED = {
    "moment": {"definition", "fitting", "losses", "operations"},
    "moments": {"definition", "fitting", "losses", "operations"},
    "band": {"definition", "equations", "operations"},
    "bands": {"definition", "equations", "fitting", "operations"},
    "bridged": {"fitting"},
}
# Modules of `fitting` that name moments, which are Adam's; a time between two frames is a bridged time.
ADAM = {"adam.py", "checkpoint_values.py", "deformation.py"}
# Whole identifiers: the same letters are right inside `lambda_msp`, `lambda_lap` and `g_lap`.
FORBIDDEN_NAMES = {
    "msp": "matern_penalty",
    "lap": "laplacian",
    "lap_weight": "lambda_lap",
    "motion_penalty": "matern_penalty",
    "spectral_penalty": "matern_penalty",
    "colour_coefficients": "appearance_coefficients",
    "position_coefficients": "motion_coefficients",
}


def rows() -> list[dict[str, str]]:
    """Every row of every table of the page, by column."""
    found = []
    for line in GLOSSARY.read_text(encoding="utf-8").splitlines():
        if line.startswith("| ") and not line.startswith("| Symbol"):
            cells = [cell.strip() for cell in line.strip("|").split(" | ")]
            assert len(cells) == len(HEADER), f"{len(cells)} cells: {line}"
            found.append(dict(zip(HEADER, cells, strict=True)))
    return found


def names(column: str) -> list[str]:
    return sorted({name for row in rows() for name in QUOTED.findall(row[column])})


def resolve(dotted: str) -> Any:
    """Module attribute, field of a class, or argument of a function, below `endotsr`."""
    path, argument = re.fullmatch(r"([\w.]+)(?:\((\w+)\))?", dotted).groups()  # pyright: ignore[reportOptionalMemberAccess]
    words = path.split(".")
    found: Any = None
    for depth in range(len(words), 0, -1):
        try:
            found = import_module(".".join(["endotsr", *words[:depth]]))
        except ModuleNotFoundError:
            continue
        for word in words[depth:]:
            fields = getattr(found, "__annotations__", {}) if inspect.isclass(found) else {}
            own = vars(found) if inspect.isclass(found) else {}
            found = getattr(found, word) if word in own or word not in fields else fields[word]
        assert argument is None or argument in inspect.signature(found).parameters, f"no argument {argument}"
        return found
    raise ModuleNotFoundError(dotted)


def settings_of(kind: type, prefix: str = "") -> set[str]:
    found = set()
    for field in msgspec.structs.fields(kind):
        inner = isinstance(field.type, type) and issubclass(field.type, msgspec.Struct)
        found |= settings_of(field.type, f"{prefix}{field.name}.") if inner else {f"{prefix}{field.name}"}
    return found


def identifiers(tree: ast.AST) -> set[str]:
    """Names that a module gives or uses: variables, attributes, arguments, keywords, functions and classes."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name) | ast.keyword(arg=str(name)):
                found.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.alias(name=name):
                found.add(name.rpartition(".")[2])
    return found


def forbidden(name: str) -> str | None:
    """What to write instead of this identifier, or None if it is allowed."""
    words = [word for word in name.lower().split("_") if word in FORBIDDEN_WORDS]
    return FORBIDDEN_WORDS[words[0]] if words else FORBIDDEN_NAMES.get(name.lower().strip("_"))


def out_of_place(name: str, room: str) -> bool:
    """Whether an identifier uses a word of other rooms; a class has its words run together."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower().split("_")
    return any(room not in RESERVED[word] for word in words if word in RESERVED)


def test_the_tables_are_read():
    assert len(rows()) > 70
    assert all(re.fullmatch(r"-|`[^`]+`(, `[^`]+`)*", row[c]) for row in rows() for c in HEADER[2:]), "a malformed cell"


@pytest.mark.parametrize("dotted", names("Code"))
def test_every_name_of_the_code_exists(dotted):
    resolve(dotted)


def test_every_setting_exists():
    assert set(names("Setting")) <= settings_of(Config)


def test_the_log_keys_are_those_of_the_trainer():
    """`test_training.py` compares the keys of a real log with these. A term may have its key on its page instead."""
    pages = (page.read_text(encoding="utf-8") for page in (GLOSSARY.parent / "specification").glob("*.md"))
    on_pages = {key for text in pages for key in re.findall(r"\bKey\s+of\s+the\s+log:\s+`(\w+)`", text)}
    assert set(names("Log")) | on_pages == set(LogEntry.__annotations__), (
        "a key of the log needs a row of the glossary, or the words 'Key of the log: `key`' on the page of its term"
    )


def test_every_golden_array_exists():
    files = json.loads((ROOT / "golden" / "manifest.json").read_text(encoding="utf-8"))["files"]
    stored = set()
    for file in files:
        match file["path"].split("/"):
            case ["cases", family, _, _, array] if array.endswith(".npy"):
                stored.add(f"{family}/{array.removesuffix('.npy')}")
    missing = set(names("Golden")) - stored
    assert not missing, f"not in golden/manifest.json: {sorted(missing)}"


def test_a_replaced_word_is_recognised():
    assert forbidden("detail_weight") and forbidden("LEAST_TISSUE_SHARE") and forbidden("msp") and forbidden("_lap")
    assert out_of_place("least_moment", "export") and out_of_place("OneMoment", "views")
    assert not out_of_place("moment", "fitting")
    assert not any(forbidden(name) for name in ("details", "lambda_msp", "g_lap", "parallel_for", "laplacian_from"))


def shown(file: Path) -> str:
    """The file as a test id, without the word that selects the gradient checks."""
    return str(file.relative_to(PACKAGE)).replace("grad" + "check", "gradient checks")


@pytest.mark.parametrize("file", sorted(PACKAGE.rglob("*.py")), ids=shown)
def test_no_identifier_uses_a_replaced_word(file):
    found = {name: forbidden(name) for name in identifiers(ast.parse(file.read_text(encoding="utf-8")))}
    wrong = {name: instead for name, instead in found.items() if instead}
    assert not wrong, f"write instead: {wrong}"
    room = house.room(".".join(file.relative_to(PACKAGE).parts)).rpartition(".")[2]
    assert [name for name in found if out_of_place(name, room)] == []


def test_letters_with_several_meanings_are_listed():
    # The rows of one symbol; the rendered image stands in two sections with one meaning.
    letters = [letter.strip() for row in rows() for letter in row["Symbol"].strip("$").split(",")]
    several = {letter for letter in letters if letters.count(letter) > 1} - {"-", r"\hat I"}
    text = GLOSSARY.read_text(encoding="utf-8")
    said = text[text.index("The letters $A$") : text.index("In the code each meaning")]
    listed = set(re.findall(r"\$([^$]+)\$", said)) - {"T", "w"}  # $T_k$ and $w_{cji}$ have an index in the rows
    assert several == listed, (
        f"rows of several meanings: {several - listed} not in the sentence, {listed - several} only there"
    )


def test_every_class_that_the_glossary_names_exists():
    """Among the rules of naming; the tables are looked up above."""
    rules = GLOSSARY.read_text(encoding="utf-8").partition("## Rules of naming")[2].partition("\n## ")[0]
    classes = {n.name for f in PACKAGE.rglob("*.py") for n in ast.walk(ast.parse(f.read_text(encoding="utf-8")))
               if isinstance(n, ast.ClassDef)}  # fmt: skip
    named = {name for name in QUOTED.findall(rules) if re.fullmatch(r"([A-Z][a-z]+)+", name)}
    assert {"Frame", "Sequence", "Pose"} <= named <= classes


def test_moments_of_a_fit_are_those_of_adam():
    named = set()
    for file in (PACKAGE / "training" / "fitting").rglob("*.py"):
        found = identifiers(ast.parse(file.read_text(encoding="utf-8")))
        if any({"moment", "moments"} & set(name.lower().split("_")) for name in found):
            named.add(file.name)
    assert named == ADAM
