"""Files and folders of a source that its layout does not read, such as masks beside the pictures of a COLMAP model.

A layout lists the names that it reads (`Layout.reads`), and a clip those that its files name (`Clip.read_here`).
"""

from collections import Counter
from fnmatch import fnmatchcase
from pathlib import Path

from endotsr.clips.sequences.files import shortened
from endotsr.clips.sequences.source_options import SourceOptions

# What accompanies recordings and says nothing about them.
BESIDE = ("readme*", "licen?e*", "*.md", "*.html", "*.pdf", "*.log", "*.sh", "*.py", "*.bat", "*.zip", "*.gz", "*.tar",
          "*.7z", "thumbs.db", "desktop.ini", "__macosx", "proposal.json")  # fmt: skip
FEW = 3  # files of one kind that are named one by one
OPTIONS = {
    "masks": ("*mask*", "*segment*", "*label*"),
    "depth": ("*depth*", "*disp*"),
    "calibration": ("*calib*", "*intrinsic*", "k.txt", "*.yaml", "*.yml", "*.ini", "*.xml", "*.mat"),
    "trajectory": ("*traj*", "*pose*", "*groundtruth*", "*odometry*"),
    "right": ("*right*",),
}


def unread(path: Path, reads: tuple[str, ...], options: SourceOptions, takes: tuple[str, ...]) -> list[str]:
    """A note on the entries of a folder that are not read, with the options that read such files; [] without any.

    reads   patterns of names that the layout reads, in lower case
    takes   options of the layout
    """
    if not path.is_dir():
        return []
    stated = [Path(value).resolve() for name in ("masks", "depth", "calibration", "trajectory", "right")
              if (value := getattr(options, name)) is not None]  # fmt: skip
    left = []
    for entry in sorted(path.iterdir()):
        name, here = entry.name.lower(), entry.resolve()
        if name.startswith(".") or any(fnmatchcase(name, pattern) for pattern in (*BESIDE, *reads)):
            continue
        if any(here == one or here in one.parents for one in stated) or (entry.is_dir() and not any(entry.iterdir())):
            continue
        left.append(entry)
    if not left:
        return []
    taken = (*takes, "right") if "stereo" in takes else takes
    hints = [f"--{option}" for option, patterns in OPTIONS.items() if option in taken
             and any(fnmatchcase(entry.name.lower(), pattern) for pattern in patterns for entry in left)]  # fmt: skip
    return [f"{path.name}: not read: {shortened(_named(left))}" + (f"; see {', '.join(hints)}" if hints else "")]


def _named(entries: list[Path]) -> list[str]:
    """The names of folders and files; of many files with one ending, their number."""
    kinds = Counter(entry.suffix.lower() for entry in entries if entry.is_file())
    many = [kind for kind, count in kinds.items() if count > FEW]
    names = [f"{entry.name}/" if entry.is_dir() else entry.name for entry in entries
             if entry.is_dir() or entry.suffix.lower() not in many]  # fmt: skip
    return names + [f"{kinds[kind]} files {kind or 'without an ending'}" for kind in many]
