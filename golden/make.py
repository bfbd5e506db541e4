"""Generate the golden vectors of this folder, and ports with one mistake each.

    python golden/make.py check [FAMILY[/CASE] ...] [--within-tolerance]   compare the files with a fresh computation
    python golden/make.py write [FAMILY[/CASE] ...] [--golden DIR]    replace the files, and print what moved
    python golden/make.py pack DIR [--golden DIR]                      write the files to hand on: see below
    python golden/make.py wrong                                        list the mistakes
    python golden/make.py wrong FLAG OUTDIR [--golden DIR]             write what a port with this mistake answers

`check` compares bitwise on the class of machine named in the manifest, and otherwise, or with `--within-tolerance`,
within the float64 tolerance. It ends with exit code 1 if anything differs. `check` and `write` compute the named
families or cases, or all; `write` keeps the stored bytes of values that agree within the tolerance. It always ends with
exit code 1: no test run may rewrite its own expected values. `wrong` writes in float64. `pack` writes the vectors as an
archive with its hash, the judge as a program that needs NumPy alone, and the data wheel `endotsr-golden`.
"""

import argparse
import sys
from pathlib import Path

from endotsr.errors import InputError
from endotsr.port.judge.store import golden_folder, read_golden
from makers.delivery import pack
from makers.generate import check, write
from makers.registry import all_wrong_ports
from makers.wrong import answer_wrongly

HERE = Path(__file__).parent


def run_check(options: argparse.Namespace) -> int:
    """Compare the folder with a fresh computation."""
    lines, summary = check(golden_folder(options.golden), options.families, bitwise=not options.within_tolerance)
    print("\n".join([*lines, f"golden: {summary}, {len(lines)} differ"]))
    return 1 if lines else 0


def run_write(options: argparse.Namespace) -> int:
    """Replace the generated files of the folder."""
    folder = golden_folder(options.golden)
    lines = write(folder, options.families)
    print("\n".join(lines) or "no expected value moved")
    remedy = f"; {folder / 'README.md'} gets a new version, if this change has none yet" if lines else ""
    print(f"golden: written, {len(lines)} changes{remedy}", file=sys.stderr)
    return 1


def run_pack(options: argparse.Namespace) -> int:
    """Write the archive of the vectors, the judge and the data wheel."""
    for path in pack(golden_folder(options.golden), options.outdir):
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    return 0


def run_wrong(options: argparse.Namespace) -> int:
    """List the mistakes, or write the outputs of a port that makes one. Raises: InputError for an unknown flag."""
    known = all_wrong_ports()
    if options.flag is None:
        print("\n".join(f"{port.flag}: {port.title} ({port.wrong})" for port in known.values()))
        return 0
    if options.flag not in known or options.outdir is None:
        raise InputError("wrong: give the FLAG of a mistake (without arguments: a list) and OUTDIR")
    count = answer_wrongly(read_golden(golden_folder(options.golden)), options.outdir, known[options.flag])
    print(f"golden: {count} cases answered wrongly in {options.outdir}")
    return 0


def main(words: list[str]) -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, call in {"check": run_check, "write": run_write, "pack": run_pack, "wrong": run_wrong}.items():
        command = commands.add_parser(name, help=call.__doc__)
        command.add_argument("--golden", type=Path, metavar="DIR", default=HERE, help="folder of the golden cases")
        command.set_defaults(call=call)
        if name == "check":
            command.add_argument("--within-tolerance", action="store_true", help="accept other bits on any machine")
        if name in ("check", "write"):
            command.add_argument("families", nargs="*", metavar="FAMILY[/CASE]", help="only these; default: all")
        if name == "pack":
            command.add_argument("outdir", type=Path, metavar="DIR", help="folder for the files")
        if name == "wrong":
            command.add_argument("flag", nargs="?", metavar="FLAG", help="name of the mistake")
            command.add_argument("outdir", nargs="?", type=Path, metavar="OUTDIR", help="folder for the outputs")
    options = parser.parse_args(words)
    try:
        return options.call(options)
    except InputError as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
