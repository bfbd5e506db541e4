"""Files and folders of a source that its layout does not read, such as masks beside the pictures of a COLMAP model.

A layout lists the names that it reads (`Layout.reads`), and a clip those that its files name (`Clip.read_here`) and the
folders from which it takes files (`Clip.inside`).
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path

from endotsr.clips.formats.files import shortened
from endotsr.clips.opencv.pictures import PICTURE_ENDINGS
from endotsr.clips.sequences.source_options import SourceOptions

# What accompanies recordings and says nothing about them.
BESIDE = ("readme*", "licen?e*", "*.md", "*.html", "*.pdf", "*.log", "*.sh", "*.py", "*.bat", "*.zip", "*.gz", "*.tar",
          "*.7z", "thumbs.db", "ehthumbs*.db", "@eadir", "desktop.ini", "__macosx", "proposal.json")  # fmt: skip
FEW = 3  # files of one kind that are named one by one
OPTIONS = {
    "masks": ("*mask*", "*segment*", "*label*"),
    "depth": ("*depth*", "*disp*"),
    "calibration": ("*calib*", "*intrinsic*", "k.txt", "*.yaml", "*.yml", "*.ini", "*.xml", "*.mat"),
    "trajectory": ("*traj*", "*pose*", "*groundtruth*", "*odometry*"),
    "right": ("*right*",),
}
Inside = Mapping[Path, tuple[str, ...]]  # folders, each with patterns of the names that are read, in lower case


def folders_of(files: Iterable[Path | None], endings: tuple[str, ...] = PICTURE_ENDINGS) -> dict[Path, tuple[str, ...]]:
    """The folders of files; a file there with one of these endings is read, or has a note of its own."""
    return {file.parent: tuple(f"*{ending}" for ending in endings) for file in files if file is not None}


def together(*found: Inside) -> dict[Path, tuple[str, ...]]:
    """All folders, each with the patterns of every part."""
    return {folder: tuple(name for part in found for name in part.get(folder, ())) for part in found for folder in part}


def unread(
    path: Path, reads: tuple[str, ...], options: SourceOptions, takes: tuple[str, ...], inside: Inside | None = None
) -> list[str]:
    """Notes on the entries of a folder and of those inside it that are not read, with the options that read such files.

    path     the folder of the source; a file has no entries
    reads    patterns of names that the layout reads, in lower case
    takes    options of the layout
    inside   further folders from which files are read; what is in a folder between them and `path` is named as well
    """
    folders = {path: reads, **{folder: names for folder, names in (inside or {}).items() if folder != path}}
    for folder in tuple(folders):
        for parent in folder.parents if path in folder.parents else ():
            if path in parent.parents:
                folders.setdefault(parent, ())
    stated = [Path(value) for name in ("masks", "depth", "calibration", "trajectory", "right")
              if (value := getattr(options, name)) is not None]  # fmt: skip
    known = [entry.resolve() for entry in (*stated, *folders)]
    taken = (*takes, "right") if "stereo" in takes else takes
    notes = []
    for folder in sorted(folder for folder in folders if folder.is_dir()):
        shown = folder.relative_to(path).as_posix() if path in folder.parents else folder.name
        left = [entry for entry in sorted(folder.iterdir()) if not _is_read(entry, (*folders[folder], *BESIDE), known)]
        notes += [_note(shown, left, taken)] if left else []
    return notes


def _note(shown: str, left: list[Path], taken: tuple[str, ...]) -> str:
    """The note on entries that are not read."""
    hints = [f"--{option}" for option, patterns in OPTIONS.items() if option in taken
             and any(fnmatchcase(entry.name.lower(), pattern) for pattern in patterns for entry in left)]  # fmt: skip
    return f"{shown}: not read: {shortened(_named(left))}" + (f"; see {', '.join(hints)}" if hints else "")


def _is_read(entry: Path, reads: tuple[str, ...], known: list[Path]) -> bool:
    """Whether an entry is read, says nothing, or leads to a path that is known. A name may look like a pattern."""
    name = entry.name.lower()
    if name.startswith(".") or any(name == pattern or fnmatchcase(name, pattern) for pattern in reads):
        return True
    here = entry.resolve()
    return any(here == one or here in one.parents for one in known) or (entry.is_dir() and not any(entry.iterdir()))


def _named(entries: list[Path]) -> list[str]:
    """The names of folders and files; of many files with one ending, their number."""
    kinds = Counter(entry.suffix.lower() for entry in entries if entry.is_file())
    many = [kind for kind, count in kinds.items() if count > FEW]
    names = [f"{entry.name}/" if entry.is_dir() else entry.name for entry in entries
             if entry.is_dir() or entry.suffix.lower() not in many]  # fmt: skip
    return names + [f"{kinds[kind]} files {kind or 'without an ending'}" for kind in many]
