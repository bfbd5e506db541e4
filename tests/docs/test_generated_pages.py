"""Every generated part of a page is what its program writes from the committed records."""

import re
from functools import partial
from importlib import import_module

import pytest
from pages.store.marks import read_json, replaced

ROW = re.compile(r"<!-- (\w+):(\w+):start -->")


def module(program):
    """The module of a program of `docs/make.py`."""
    room, _, name = program.partition(".")
    return import_module(f"pages.{room}.{name or 'page'}")


def of_record(*tables, **named):
    """Parts made by functions of the module from its record: by their own name, or under a name of the page."""
    functions = dict.fromkeys(tables) | named

    def made(about):
        record = read_json(about.FILE, "docs/make.py")
        return {name: getattr(about, function or name)(record) for name, function in functions.items()}

    return made


def whole(name, about):
    """All parts at once, from a function without arguments."""
    return getattr(about, name)()


def fragments_of_record(about):
    return about.fragments(read_json(about.FILE, about.MADE_BY))


PARTS = partial(whole, "parts")
GENERATED = {  # program -> its parts by name
    "bench": lambda about: about.fragments(about.read(about.RESULTS), about.read_runs(about.RESULTS)),
    "bench.minutes": lambda about: about.parts(read_json(about.FILE, "")),
    "bench.scale": PARTS,
    "bench.waiting": lambda about: about.parts(read_json(about.FILE, "")),
    "book.chapters": lambda about: {"table": about.table(about.chapters(), read_json(about.FILE, about.COMMAND))},
    "book.presets": lambda about: {"recorded": about.recorded(), "simulated": about.simulated()},
    "book.readme_gaps": PARTS,
    "book.readme_presets": PARTS,
    "book.reliability": PARTS,
    "book.systems": PARTS,
    "claims.base_checkpoint": lambda about: {"calibration": about.table(read_json(about.RECORD, "")["cells"])},
    "claims.mask_folders": lambda about: {"folders": about.table(read_json(about.RECORD, ""))},
    "claims.paper": PARTS,
    "effects": lambda about: about.fragments(about.read()),
    "full_size": lambda about: import_module("pages.full_size.text").fragments(read_json(about.FILE, about.COMMAND)),
    "full_size.depth_outliers": PARTS,
    "full_size.interpolation": of_record("table"),
    "full_size.sweeps": partial(whole, "fragments"),
    "full_size.targets": of_record("table"),
    "ports.injected": fragments_of_record,
    "ports.unseen": fragments_of_record,
    "recordings.any_clip": of_record(ways="table"),
    "recordings.pose_returns": lambda about: about.tables(read_json(about.FILE, "")),
    "recordings.hand_held": lambda about: about.tables(read_json(about.FILE, "")),
    "recordings.inputs_tried": of_record("table"),
    "recordings.inventories": lambda about: {"fields": about.fields(), "options": about.options()},
    "recordings.masks": of_record(iou="table"),
    "recordings.masks_drawn": of_record("table"),
    "recordings.masks_training": of_record("table"),
    "recordings.masks_keys": of_record("table", drafts="draft_table"),
    "recordings.one_camera": of_record("table"),
    "recordings.own_pictures": of_record(ways="table"),
    "recordings.pose_readings": of_record("table"),
    "recordings.poses": of_record("table"),
    "recordings.scope_video": of_record("table"),
    "recordings.show": of_record(sizes="table"),
    "recordings.simulate": of_record(times="table"),
    "recordings.sinus": of_record(rows="table"),
    "tradeoff": PARTS,
}


@pytest.mark.parametrize("program", GENERATED)
def test_a_page_is_what_its_program_writes(program):
    about = module(program)
    made, text = GENERATED[program](about), about.PAGE.read_text(encoding="utf-8")
    rooms = {room for room, name in ROW.findall(text) if name in made}
    mine = [room for room in rooms if {name for r, name in ROW.findall(text) if r == room} == set(made)]
    assert mine, f"no room of marks has the parts {sorted(made)}"
    right = any(replaced(text, made, about.PAGE, room) == text for room in mine)
    assert right, f"run: python docs/make.py {program}"
