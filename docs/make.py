"""Programs that measure and write the generated parts of the documentation: python docs/make.py [NAME [WORDS ...]]

Without a name: the list of all programs. `claims` runs `docs/pages/claims/page.py`; `claims.paper` runs
`docs/pages/claims/paper.py`. Without words a program rewrites its parts of the pages from its record, a file of
`docs/results`; with the word `measure` it makes the record first. `NAME measure --help` lists the options.

A generated part of a page stands between marks such as `<!-- presets:whole:start -->`. With the words of a mark,
`python docs/make.py presets:whole` prints the command that writes the part.
"""

import ast
import re
import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent
PAGES = HERE / "pages"
ROOM = re.compile(r'\broom="(\w+)"|\bwrite_marked\(.*, "(\w+)"\)')  # of the marks, where the file has another name
STARTS = re.compile(r"^(PROGRAM = Program\(|def main\(words: list\[str\])", re.MULTILINE)  # `pages.store.program`


def programs() -> dict[str, Path]:
    """Every program by name: a file of a folder of `docs/pages` that can be run."""
    found = {}
    for file in sorted(PAGES.glob("*/*.py")):
        if STARTS.search(file.read_text(encoding="utf-8")):
            found[file.parent.name if file.stem == "page" else f"{file.parent.name}.{file.stem}"] = file
    return found


def first_line(file: Path) -> str:
    """The first line of the docstring."""
    return (ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or "").split("\n")[0]


def writers(mark: str) -> list[str]:
    """Programs that write the part of a mark, ROOM:PART; all programs of the room if none states the part by name."""
    room, _, part = mark.partition(":")
    texts = {name: file.read_text(encoding="utf-8") for name, file in programs().items()}
    other = {name: next(filter(None, found.groups())) for name, text in texts.items() if (found := ROOM.search(text))}
    mine = [name for name in texts if other.get(name, name.rpartition(".")[2]) == room]
    return [name for name in mine if f'"{part}"' in texts[name]] or mine


def main(words: list[str]) -> int:
    """Run a program, or list all. Returns: the exit code."""
    found = programs()
    if not words or words[0] in ("-h", "--help"):
        width = max(map(len, found))
        print(__doc__)
        print("\n".join(f"    {name:{width}}  {first_line(file)}" for name, file in found.items()))
        return 0
    name, *rest = words
    if ":" in name and (mine := writers(name)):
        print("\n".join(f"python docs/make.py {one}" for one in mine))
        return 0
    if name not in found:
        print(f"docs/make.py: {name!r} is not a program; use one of: {', '.join(found)}", file=sys.stderr)
        return 2
    sys.path[:0] = [str(HERE), str(HERE.parent / "golden")]  # `pages`, and `makers` of the golden cases
    sys.argv = [f"docs/make.py {name}", *rest]  # the name that argparse prints
    module = import_module("pages." + ".".join(found[name].relative_to(PAGES).with_suffix("").parts))
    (module.PROGRAM.run if hasattr(module, "PROGRAM") else module.main)(rest)
    return 0


if __name__ == "__main__":
    from endotsr.cli.parts.closed_pipe import until_closed

    sys.exit(until_closed(lambda: main(sys.argv[1:])))
