"""One command for every program of the pages.

    python docs/make.py NAME                              rewrite its parts of the page from the stored record
    python docs/make.py NAME measure [OPTIONS]            measure, write the record, then rewrite the parts
    python docs/make.py NAME measure --record FILE        measure into another file, and print the parts

`measure --help` lists the options.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from endotsr.errors import InputError
from endotsr.training.runs.files import write_json
from endotsr.training.runs.machine import dated
from pages.store import kept
from pages.store.marks import read_json, write_marked

DOCS = Path(__file__).parents[2]
RESULTS, DATA = DOCS / "results", DOCS.parents[1] / "shared" / "data"
Record = Any  # content of a file of docs/results
Parts = Mapping[str, Callable[..., str]] | Callable[..., Mapping[str, str]]


@dataclass(frozen=True)
class Program:
    """What a module measures, and the parts of pages that it writes."""

    module: str  # `__name__` of the module
    page: str | tuple[str, ...] = ()  # below docs
    parts: Parts = field(default_factory=dict)  # by name; the functions get the record, if there is one
    record: str = ""  # below docs/results
    measure: Callable[[argparse.Namespace], Any] | None = None
    # options -> record, whose file is `options.record`; None if the function has written its files itself
    options: Mapping[str, Any] = field(default_factory=dict)  # of `measure`: a default, or arguments of `add_argument`
    draw: Callable[[Record], object] | None = None  # pictures from the record
    room: str = ""  # of the marks; by default the name of the module
    stamped: bool = True  # the record gets date, machine and versions

    @property
    def name(self) -> str:
        """The word for `docs/make.py`."""
        return self.module.removeprefix("pages.").removesuffix(".page")

    @property
    def file(self) -> Path:
        """The record."""
        return RESULTS / self.record

    @property
    def pages(self) -> tuple[Path, ...]:
        """The pages with parts of this program."""
        return tuple(DOCS / page for page in ([self.page] if isinstance(self.page, str) else self.page))

    @property
    def marks(self) -> str:
        """The room of its marks."""
        return self.room or self.name.rpartition(".")[2]

    def read(self) -> Record:
        """The stored record. Raises: InputError with the command that makes it."""
        return read_json(self.file, f"python docs/make.py {self.name} measure")

    def made(self, record: Record = None) -> dict[str, str]:
        """The generated parts by name; without an argument, of the stored record."""
        given = [self.read() if record is None else record] if self.record else []
        if callable(self.parts):
            return dict(self.parts(*given))
        return {name: make(*given) for name, make in self.parts.items()}

    def write(self) -> None:
        """Rewrite pictures and pages from the stored record."""
        made = self.made()
        if self.draw:
            self.draw(self.read() if self.record else None)
        for page in self.pages:
            write_marked(page, made, self.marks)

    def run(self, words: list[str]) -> None:
        """The command."""
        about = str(sys.modules[self.module].__doc__)
        try:
            if words[:1] == ["measure"] and self.measure:
                options = self._parser(about).parse_args(words[1:])
                found = self.measure(options)
                if found is not None:
                    write_json(options.record, dated(found) if self.stamped else found)
                    kept.finished(options.record)
                if self.record and options.record != self.file:
                    return print("\n\n".join(self.made(read_json(options.record, self.name)).values()))
            elif words:
                sys.exit(about)
            self.write()
        except InputError as error:
            sys.exit(f"error: {error}")

    def _parser(self, about: str) -> argparse.ArgumentParser:
        parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        for name, value in self.options.items():
            usual = {"default": value, "type": Path if isinstance(value, Path) else type(value)}
            parser.add_argument(name, **(value if isinstance(value, dict) else usual))
        if self.record:
            parser.add_argument("--record", type=Path, default=self.file, metavar="FILE", help="in place of the record")
        return parser


CLIP = {"type": Path, "metavar": "CLIP"}  # options of several programs
CLIPS = {**CLIP, "nargs": "*"}
LPIPS = {"type": Path, "metavar": "FILE", "help": "AlexNet LPIPS weights"}
RUN = {"type": Path, "metavar": "RUN"}
RUNS = {**RUN, "nargs": "+"}
