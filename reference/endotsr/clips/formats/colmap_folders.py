"""Where a folder has COLMAP models and their pictures, and which model is read.

COLMAP writes one model per connected part of a recording: `sparse/0`, `sparse/1`, ... Their numbers say nothing about
their sizes. In: the folder. Out: the model with the most registered pictures, or the stated one.
"""

from pathlib import Path
from typing import NamedTuple

from endotsr.clips.formats.colmap_model import registered_count
from endotsr.clips.formats.files import shortened
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.errors import InputError
from endotsr.untrusted.names import choice, counted, relative_path

# Folders with models, or with numbered folders of models; the first that has one counts.
PLACES = (".", "sparse", "colmap/sparse", "dense", "distorted/sparse")
PICTURES = ("images", "input", ".")  # folders of the pictures, beside the models


class ChosenModel(NamedTuple):
    """The model that is read."""

    folder: Path
    notes: list[str]  # on the other models


def find_models(path: Path) -> list[Path]:
    """The folders of the models of a folder, by name; empty without a model."""
    for place in PLACES:
        root = path / place
        if not root.is_dir():
            continue
        inner = sorted(folder for folder in root.iterdir() if folder.is_dir() and folder.name.isdigit())
        found = [folder for one in (root, *inner) for folder in (one, one / "sparse") if _is_model(folder)]
        if found:
            return found
    return []


def _is_model(folder: Path) -> bool:
    return any((folder / f"cameras{ending}").is_file() for ending in (".txt", ".bin"))


def choose_model(path: Path, name: str = "") -> ChosenModel:
    """The model of this name, or the one with the most registered pictures.

    name   name or path of its folder inside `path`, such as 1 or sparse/1; "": the largest

    Raises:  InputError without a model, and for a name that no model has.
    """
    models = find_models(path)
    if not models:
        raise InputError(f"{path}: holds no COLMAP model (cameras.txt or cameras.bin, also in sparse/0)")
    counts = {folder: registered_count(folder) for folder in models}
    names = {folder: _shown(folder, path) for folder in models}
    if name:
        wanted = name.replace("\\", "/").strip("/")
        found = next((folder for folder in models if wanted in (names[folder], folder.name)), None)
        if found is None:
            raise InputError(f"{path}: --model {name}: no such model; use {choice(names.values())}")
    else:
        found = max(models, key=lambda folder: counts[folder])
    others = [f"{names[folder]} ({counted(counts[folder], 'picture')})" for folder in models if folder != found]
    forms = [ending for ending in (".txt", ".bin") if (found / f"cameras{ending}").is_file()]
    notes = [f"{names[found]}: the text files are read, not the binary ones beside them"] if len(forms) > 1 else []
    if not others:
        return ChosenModel(found, [*notes, *(["there is one model: --model changes nothing"] if name else [])])
    why = "as stated" if name else "the largest model"
    return ChosenModel(
        found, [*notes, f"{names[found]} is read, {why}; not read: {', '.join(others)}; --model selects one"]
    )


def _shown(folder: Path, path: Path) -> str:
    """The path of a model inside the folder."""
    inside = folder.relative_to(path).as_posix()
    return folder.name if inside == "." else inside


def files_of_model(path: Path, folder: Path, names: list[str]) -> list[Path]:
    """The files of registered pictures.

    path     the folder of the recording
    folder   that of the model
    names    of the pictures, relative to their common folder

    Raises:  InputError for a missing picture, or a name that leaves its folder.
    """
    inner = [relative_path(name, f"{folder}: a picture of the COLMAP model") for name in names]
    parts = folder.relative_to(path).parts
    bases = [path.joinpath(*parts[:k]) for k in range(len(parts), -1, -1)]
    if not parts:  # the model itself is named: its pictures are beside it or above it
        bases += list(path.resolve().parents[:2])
    places = [base / name for base in bases for name in PICTURES]
    place = next((place for place in places if (place / inner[0]).is_file()), path / PICTURES[0])
    missing = next((name for name in inner if not (place / name).is_file()), None)
    if missing is not None:
        raise InputError(f"{place / missing}: file not found; the COLMAP model registers it")
    return [place / name for name in inner]


def unregistered(files: list[Path], where: str = "registered in this model") -> list[str]:
    """A note on the pictures beside the registered ones that no pose belongs to."""
    known, beside = set(files), []
    for folder in sorted({file.parent for file in files}):
        beside += [file.name for file in sorted(folder.iterdir())
                   if file.suffix.lower() in PICTURE_ENDINGS and file not in known and file.name[0] != "."]  # fmt: skip
    if not beside:
        return []
    return [f"{len(beside)} pictures are not {where} and are left out: {shortened(beside)}"]
