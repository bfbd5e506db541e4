"""Operations of the golden cases, and profiles of a port: the tables of golden/README.md.

A family of `golden/makers` declares the note of an operation; the profiles are those of the judge.
"""

from collections.abc import Iterable

from endotsr.port.contract import all_operations
from endotsr.port.judge.profiles import FILES, PROFILES, Profile
from endotsr.results.report.tables import markdown
from makers.registry import DECLARED
from pages.store.program import Program


def listed(names: Iterable[str]) -> str:
    """Operations as code, divided by commas."""
    return ", ".join(f"`{name}`" for name in names)


def operations() -> str:
    """One row for each operation: its equations and its note."""
    rows = []
    for name, operation in all_operations().items():
        declared = DECLARED[name]
        label = f"({operation.equation})" if operation.equation else ""
        rows.append((f"`{name}`", declared.equations or label, declared.note))
    return markdown(("Operation", "Equation", "Notes"), rows)


def asked(profile: Profile) -> str:
    """The operations of a profile, or those that it lacks where these are fewer."""
    lacking = [name for name in all_operations() if name not in profile.operations]
    if len(lacking) < len(profile.operations):
        return f"every operation but {listed(lacking)}"
    return listed(name for name in profile.operations if name not in FILES)


def profiles() -> str:
    """One row for each profile, with what is right at its last level."""
    heads = ("`--profile`", f"Operations, with {' and '.join(f'`{name}`' for name in FILES)}", "Last level")
    rows = []
    for name, profile in PROFILES.items():
        last = max(profile.says)
        without = ", without `d_...`" if profile.forward else ""
        rows.append((f"`{name}`", f"{asked(profile)}{without}", f"{last}: {profile.says[last]}"))
    return markdown(heads, rows)


PROGRAM = Program(__name__, "../golden/README.md", {"table": operations, "profiles": profiles})
