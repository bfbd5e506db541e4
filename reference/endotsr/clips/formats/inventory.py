"""What becomes of every field of a file: used, refused by name, told, or harmless. A field that is not listed is noted.

A reader of a format has an `Inventory` beside it. `noted` applies it to the names in a file.
"""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatchcase
from typing import NamedTuple

from endotsr.clips.formats.files import shortened
from endotsr.errors import InputError
from endotsr.untrusted.names import plain_line, shown


class Inventory(NamedTuple):
    """The fields of a format. The keys are names, several separated by spaces; `*` stands for any characters."""

    about: str  # the format, in words
    used: Mapping[str, str]  # names -> meaning
    refused: Mapping[str, str] = {}  # names -> what they would change, and the remedy
    harmless: Mapping[str, str] = {}  # names -> why they change nothing
    neutral: Mapping[str, tuple[object, ...]] = {}  # values with which a refused field changes nothing
    told: Mapping[str, str] = {}  # names -> what a note says, because the field is not applied

    def reason(self, use: Mapping[str, str], name: str) -> str | None:
        """The text on a name in one of the groups; None if it is not there."""
        return next((text for names, text in use.items() if any(fnmatchcase(name, n) for n in names.split())), None)

    @property
    def listed(self) -> tuple[str, ...]:
        """The patterns of all names that are used, told or harmless, such as those of files in a folder."""
        return tuple(name for use in (self.used, self.told, self.harmless) for names in use for name in names.split())

    def telling(self, names: Iterable[str], where: object) -> list[str]:
        """Notes on names that are not applied; other names are passed over. For files, whose names are lowered."""
        found = [(name, self.reason(self.told, name.lower())) for name in names]
        return [f"{where}: {plain_line(name)[:60]}: {text}" for name, text in found if text is not None]

    def noted(self, fields: Mapping[str, object] | Iterable[str], where: object) -> list[str]:
        """Notes on the fields of a file that are not applied or not listed.

        fields   names, with their values if these decide

        Raises:  InputError naming a refused field.
        """
        values = fields if isinstance(fields, Mapping) else {}
        unknown, told = [], []
        for name in map(str, fields):
            why = self.reason(self.refused, name)
            if why is not None and not (name in values and self._changes_nothing(name, values[name])):
                raise InputError(f"{where}: {name} = {shown(values[name])}: {why}" if name in values else
                                 f"{where}: {name}: {why}")  # fmt: skip
            said = self.reason(self.told, name)
            if said is not None and not (name in values and self._changes_nothing(name, values[name])):
                told.append(f"{where}: {plain_line(name)[:60]}: {said}")
            if (
                said is why is None
                and self.reason(self.used, name) is None
                and self.reason(self.harmless, name) is None
            ):
                unknown.append(plain_line(name)[:60])
        if unknown:
            told.append(f"{where}: not used, because unknown here: {shortened(sorted(set(unknown)))}")
        return told

    def _changes_nothing(self, name: str, value: object) -> bool:
        """Whether a refused field has a neutral value: nothing, zero, false, empty or one that is listed."""
        if not value or (isinstance(value, list) and not any(value)):
            return True
        if isinstance(value, dict) and not any(value.values()):  # such as roi of rostopic echo
            return True
        return any(value == neutral for neutral in self.neutral.get(name, ()))
