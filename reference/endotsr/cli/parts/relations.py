"""Relations of the options of a command: which ones exclude one another, and which ones need another.

In: the relations of `related_options`, and the options given on the command line. Out: nothing, or an
InputError with both options and the reason. An option is never ignored in silence: a command states a relation for
every option that another one makes pointless.

A term names an option as it is written, without the dashes: `rate`, `kind=relative`, `no-evaluate`. `rate` holds if the
option is given; in a list of what another option needs, it holds if its value is other than 0 and off. `kind=relative`
holds for this value, whether given or the default; `methods>1` for more than one value; `sequence.*` for any setting of
this section on the command line.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from endotsr.errors import InputError

# Names of facts: of the source of `prepare`, of --out of `export` and `tradeoff`, and of METHOD of `evaluate`.
FACTS = ("layout", "format", "folder", "run")
NO_FACTS: Mapping[str, str] = MappingProxyType({})


class Excludes(NamedTuple):
    """None of `first` can be given together with one of `second`."""

    first: tuple[str, ...]
    second: tuple[str, ...]
    why: str
    unless: tuple[str, ...] = ()  # with one of these, the relation does not count


class Needs(NamedTuple):
    """Each of `first` has no effect unless one of `second` holds."""

    first: tuple[str, ...]
    second: tuple[str, ...]
    why: str
    unless: tuple[str, ...] = ()  # with one of these, the relation does not count


Relation = Excludes | Needs


class _Line(NamedTuple):
    """A command line."""

    options: Any  # the options of a command, with their defaults
    given: frozenset[str]  # names of the options that are on the command line
    facts: Mapping[str, str]  # what follows from the values, such as the layout of the source


def check_relations(
    command: str,
    relations: Iterable[Relation],
    options: Any,
    given: frozenset[str],
    facts: Mapping[str, str] = NO_FACTS,
) -> None:
    """Raises InputError for the first relation that a command line violates.

    relations  those of the command in `related_options`
    options   the options of a command, with their defaults
    given     names of the options on the command line, as in a term
    facts     name and value of what follows from the options; terms name them too, as in `layout=tum`
    """
    line = _Line(options, given, facts)
    for relation in relations:
        if any(_is_given(term, line) for term in relation.unless):
            continue
        for first in (term for term in relation.first if _is_given(term, line)):
            if isinstance(relation, Needs):
                if not any(_holds(term, line) for term in relation.second):
                    raise InputError(f"{command}: {missing(first, relation)}")
            else:
                other = next((term for term in relation.second if term != first and _is_given(term, line)), None)
                if other is not None:
                    raise InputError(f"{command}: {excluded(first, other, relation)}")


def excluded(first: str, other: str, relation: Excludes) -> str:
    """The message for two terms that exclude one another; a fact and a number of values cannot be omitted."""
    if ">" in other or other.partition("=")[0] in FACTS:
        return f"{shown(first)} has no effect with {shown(other)}: {relation.why}; omit {shown(first)}"
    return f"{shown(first)} with {shown(other)}: {relation.why}; use one of them"


def missing(first: str, relation: Needs) -> str:
    """The message for an option whose partner is missing."""
    partners = " or ".join(map(shown, relation.second))
    return f"{shown(first)} has no effect without {partners}: {relation.why}; add it, or omit {shown(first)}"


def shown(term: str) -> str:
    """A term as it is written on the command line: `--kind relative`; a fact as `the layout tum`."""
    name, more, least = term.partition(">")
    if more:
        return f"several {name}" if int(least) else name
    name, equals, value = term.partition("=")
    return f"the {name} {value}" if equals and name in FACTS else f"--{name} {value}" if equals else f"--{name}"


def _value(name: str, line: _Line) -> Any:
    """The value of an option; that of a section of settings is found by the names of section and key."""
    if name in line.facts:
        return line.facts[name]
    options, path = line.options, name.replace("-", "_").split(".")
    if not hasattr(options, name.replace("-", "_")):  # of a section
        options = getattr(options, "settings", getattr(options, "stereo", None))
    for part in path:
        options = getattr(options, part, None)
    return options


def _is_given(term: str, line: _Line) -> bool:
    """Whether a term is on the command line. A value counts also as a default, and a switch only if it is on."""
    name, more, least = term.partition(">")
    if more:
        return len(_value(name, line)) > int(least)
    if term.endswith(".*"):
        return any(given.startswith(term[:-1]) for given in line.given)
    name, equals, value = term.partition("=")
    if equals:
        found = _value(name, line)
        return value in map(str, found) if isinstance(found, tuple) else str(found) == value
    if name not in line.given:
        on = "".join(name.rsplit("no-", 1))
        return on != name and on in line.given and _value(on, line) is False
    return _value(name, line) is not False


def _holds(term: str, line: _Line) -> bool:
    """Whether a term has this value, or any value that switches something on."""
    return _is_given(term, line) if "=" in term or ">" in term else bool(_value(term, line))
