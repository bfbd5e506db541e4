"""`endotsr masks`: instrument masks for a clip without masks, proposed or carried from a few key frames."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from endotsr.cli.parts.fields import Option
from endotsr.cli.parts.parser import parse
from endotsr.cli.parts.result import JsonFile, write_result
from endotsr.errors import InputError
from endotsr.untrusted.names import counted


@dataclass
class MasksOptions:
    """Propose instrument masks from metallic grey and from motion relative to the tissue, or carry drawn ones.

    --draw writes a page on which a person draws the masks of a few frames and saves them as keys.json. With --keys,
    these masks, or those of any program, are carried to all frames by dense flow from both sides. The command names the
    frames whose two sides disagree, and the frame whose mask would help most. --draw with --keys writes a page with
    this frame: draw it, and repeat the command with --replace.

    Without --out, SEQUENCE is a folder from `endotsr prepare`, and the masks are added to it. With --out, SEQUENCE is
    any source of `prepare`; masks/ and the overlay are written to FOLDER and marked as a proposal. Inspect
    proposed_masks.png before training. Exit code 1: nothing found and written.
    """

    sequence: Annotated[Path, Option("SEQUENCE", positional=True)]
    """folder with sequence.toml, or with --out any source"""
    out: Annotated[Path | None, Option("FOLDER")] = None
    """folder to create, instead of adding the masks to the sequence"""
    layout: Annotated[str, Option("NAME")] = "auto"
    """layout of the source instead of the detected one"""
    draw: Annotated[Path | None, Option("PAGE.html", written=True)] = None
    """write the page to draw on, and no masks"""
    key_frames: int = 5
    """with --draw and without --keys: number of frames of the page"""
    keys: Annotated[Path | None, Option("KEYS")] = None
    """masks of key frames: keys.json of the page, or a folder of PNG pictures named as their frames, white =
    instrument; all black where there is none"""
    margin: int = 2
    """with --keys: px by which the masks grow; 0 = the carried outline itself"""
    replace: bool = False
    """replace existing masks; with --out, those of an earlier call"""
    json: JsonFile = None
    """also write the result as JSON"""


def run(words: list[str]) -> int:
    """The command."""
    options = parse(MasksOptions, words, "masks")
    from endotsr.clips.formats.files import shortened
    from endotsr.clips.masks.make_masks import OVERLAY, enter_masks, from_keys, write_proposal
    from endotsr.clips.sequences.layouts import describe
    from endotsr.clips.sequences.sequence_file import MASKS
    from endotsr.clips.sequences.source_options import SourceOptions

    if options.margin < 0:
        raise InputError(f"masks: --margin {options.margin} is not allowed; use 0 or more pixels")
    if options.draw is not None:
        return _draw(options, options.draw)
    said: list[str] = []
    propose = None if options.keys is None else from_keys(options.keys, options.margin, said)
    _refuse_place(options)
    if options.out is None:
        proposal, place = enter_masks(options.sequence, options.replace, propose), options.sequence
    else:
        clip = describe(options.sequence, SourceOptions(layout=options.layout))
        proposal, place = write_proposal(clip, options.out, propose, options.replace), options.out
    fraction = sum(float(plane.mean()) for plane in proposal.excluded) / max(len(proposal.excluded), 1)
    write_result(
        options.json, folder=place, found=proposal.found, reason=proposal.reason, excluded_fraction=fraction,
        field_of_view=1 - proposal.outside, frames_without_tissue=list(proposal.without_tissue),
    )  # fmt: skip
    if not proposal.found:
        print(f"{options.sequence}: no masks proposed: {proposal.reason}; nothing was written")
        return 1
    print(f"{options.sequence}: {proposal.reason}; {fraction:.1%} of the pixels are excluded")
    if proposal.without_tissue:
        named = shortened([str(i) for i in proposal.without_tissue])
        print(f"warning: hardly any tissue is left in {counted(len(proposal.without_tissue), 'frame')}: {named}")
    print(*said, sep="\n", end="\n" if said else "")
    print(f"these masks are proposals: inspect {place / OVERLAY} before training")
    if options.out is not None:
        source, masks = shlex.quote(str(options.sequence)), shlex.quote(str(options.out / MASKS))
        print(f"next: endotsr prepare {source} --masks {masks} --out SEQUENCE")
    return 0


def _refuse_place(options: MasksOptions) -> None:
    """Raises InputError, before the motion of the clip is computed, for a place where no masks can be written, or
    where they would replace or join the pictures or the masks of the key frames."""
    from endotsr.clips.sequences.sequence_file import MASKS
    from endotsr.training.runs.files import refuse_folder, refuse_inside, refuse_linked, refuse_nested, refuse_read_only
    from endotsr.untrusted.writing import refuse_existing

    keys, place = options.keys, (options.out or options.sequence) / MASKS
    if keys is not None and keys.exists() and keys.resolve().is_relative_to(place.resolve()):
        raise InputError(
            f"--keys {keys}: {place} would be replaced; copy the masks of the key frames to another folder"
        )
    if options.out is None:
        refuse_linked(options.sequence / MASKS)
        return refuse_read_only(options.sequence)
    refuse_nested(options.sequence, options.out, (MASKS,))
    if keys is not None:
        refuse_inside(options.out, keys, "the masks of the key frames")
    if not options.replace:
        refuse_existing(options.out)
    refuse_folder(options.out)


def _draw(options: MasksOptions, page: Path) -> int:
    """Write the page to draw on."""
    from endotsr.clips.masks.make_masks import drawing_for
    from endotsr.clips.sequences.layouts import describe
    from endotsr.clips.sequences.source_options import SourceOptions
    from endotsr.results.views.draw_page import check_draw_page, write_draw_page
    from endotsr.untrusted.marks import refuse_foreign

    check_draw_page(page)
    refuse_foreign(page, option="--draw")
    clip = describe(options.sequence, SourceOptions(layout=options.layout))
    drawing = drawing_for(clip, options.keys, options.key_frames)
    command = carrying_command(options.sequence)
    write_draw_page(page, drawing, f"Masks of {options.sequence.absolute().name}", command)
    drafts = [frame for frame in drawing.frames if frame.draft]
    write_result(
        options.json, page=page, frames=[frame.frame for frame in drawing.frames],
        drawn=[frame.frame for frame in drawing.frames if frame.key], drafts=[frame.frame for frame in drafts],
    )  # fmt: skip
    kind = f" ({drafts[0].draft.origin})" if drafts and drafts[0].draft else ""
    print(f"{page}: {counted(len(drawing.frames), 'frame')} to draw, {len(drafts)} of them with a draft{kind}")
    return 0


def carrying_command(source: Path) -> str:
    """The command that carries the drawn masks, for the page.

    A folder with `sequence.toml` receives the masks. Those of any other source go to a new folder next to the page,
    which `prepare --masks` takes.
    """
    from endotsr.clips.sequences.sequence_file import FILE_NAME

    place = "" if (source / FILE_NAME).is_file() else f"--out {shlex.quote(f'{source.absolute().stem}_masks')} "
    return f"endotsr masks {shlex.quote(str(source))} --keys keys.json {place}--replace"
