"""From a clip to a checked `Sequence`: the frames that a training uses, as arrays.

In: a `Clip` of a layout that training reads directly, and the settings. Out: a `Sequence` whose notes state every
assumption, or an `InputError`. The steps, in order: reading, world, tissue fraction and polarity, depth, scaling.
"""

import shlex
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from endotsr.clips.formats.files import hash_files
from endotsr.clips.opencv.pictures import read_picture
from endotsr.clips.sequences.checks.copies import copied_frames, picture_numbers, steps_between, without_twins
from endotsr.clips.sequences.checks.depth import DepthFacts, depth_facts, depth_note, far_limits
from endotsr.clips.sequences.checks.frames import FrameFacts, frame_facts
from endotsr.clips.sequences.checks.guard import guarded
from endotsr.clips.sequences.checks.kinds import KINDS, ONE_CAMERA
from endotsr.clips.sequences.clip import Clip, colour_picture, grey_plane
from endotsr.clips.sequences.depth_files import check_depth_scale, clip_depth, depth_plane, read_plane
from endotsr.clips.sequences.depth_outliers import outlying_frames, remove_outliers
from endotsr.clips.sequences.folder_reader import of_size
from endotsr.clips.sequences.frame_store import FrameStore
from endotsr.clips.sequences.layouts import describe_for_training, without_faults
from endotsr.clips.sequences.mask_polarity import check_polarity, check_single_masks
from endotsr.clips.sequences.masks import check_tissue_fraction, tissue_masks
from endotsr.clips.sequences.sequence import Sequence
from endotsr.clips.sequences.smaller import smaller, trained_size
from endotsr.clips.sequences.splits import selected_frames, split_frames
from endotsr.clips.sequences.times import normalised_times
from endotsr.clips.sequences.world import fitting_world, moved_cameras, world_note
from endotsr.config import PERCENTILES, SequenceConfig, enclose_median
from endotsr.errors import InputError
from endotsr.method.splatting.camera import camera_centre
from endotsr.untrusted.files import in_threads

NEAR = 0.2  # near plane of every preset, scene units
NO_MASKS = "no masks: every pixel counts as tissue, instruments included"
NOT_METRIC = "not metric: "  # a note on assumed depth begins so
EVERYTHING = (0.0, 100.0)  # percentiles that clip nothing
Facts = tuple[FrameFacts, DepthFacts]  # of one frame, for the checks


def read_sequence(path: Path, config: SequenceConfig, near: float = NEAR) -> Sequence:
    """The frames of a folder that `config` selects, as `sequence_of`.

    Raises:  InputError; for a layout that training does not read directly, with the command that converts it.
    """
    return sequence_of(describe_for_training(path, config), config, near)


def sequence_of(clip: Clip, config: SequenceConfig, near: float = NEAR) -> Sequence:
    """The frames of a clip that `config` selects.

    near     near plane, scene units; a sequence whose depth is entirely in front of it is refused

    Frame range, split and t = i / n apply to the selected frames. Masks become True = tissue. Depth is clipped per
    frame to percentiles of its non-zero values (0 stays 0), and outliers are removed if configured. Then everything is
    scaled by `config.scale`: pictures are averaged over areas, a pixel is tissue only if all pixels it covers are,
    depth is the mean of the non-zero values it covers, and the camera follows.

    Raises:  InputError naming file, frame and reason.
    """
    check_percentiles(config)
    clip = usable(clip)
    frames = selected_frames(config, clip.count, clip.where)
    config, notes = _depth_percentiles(clip, config)
    sequence, store = _allocated(clip, frames, config, notes)
    facts = _filled(sequence, clip, frames, config, store)
    facts = _without_depth_outliers(sequence, facts) if config.depth_outliers == "removed" else facts
    sequence = _without_twins(sequence, facts, clip)
    sequence = _in_scene_units(sequence, clip)
    notes += _mask_notes(sequence, clip, config)
    assert clip.depth is not None
    unit = "scene units" if clip.arbitrary else clip.unit_in_words
    notes.append(depth_note(sequence.depth, near, clip.depth.files[0].parent, unit))
    notes += guarded(clip, frames, sequence, facts, near)
    notes += [store.note] if store.note else []
    if clip.masks:
        names = [str(clip.masks.files[i]) for i in frames]
        notes += check_single_masks(
            sequence.masks, sequence.depth, sequence.images, names, config.allow_tissue_fraction
        )
    size = trained_size(sequence.width, sequence.height, config.scale, clip.where)
    if config.scale != 1.0:
        sequence = _scaled(sequence, size, clip, config)
    return sequence


def file_hashes(path: Path, config: SequenceConfig) -> dict[str, str]:
    """SHA-256 (hex) of every file that `read_sequence` reads with these settings, by path inside the folder."""
    clip = usable(describe_for_training(path, config))
    assert clip.depth is not None and clip.stated_in is not None
    masks = clip.masks.files if clip.masks else []
    frames = selected_frames(config, clip.count, clip.where)
    files = [files[i] for files in (clip.images, masks, clip.depth.files) if files for i in frames]
    return hash_files(clip.where, [*files, clip.stated_in])


def usable(clip: Clip) -> Clip:
    """The clip. Raises InputError for a fault, distorted pictures or missing depth."""
    clip = without_faults(clip)
    if clip.intrinsics and any(clip.intrinsics.distortion):
        command = f"endotsr prepare {shlex.quote(str(clip.where))} --out FOLDER"
        raise InputError(f"{clip.where}: the pictures are distorted (camera.distortion); `{command}` straightens them")
    if clip.depth is None:
        remedy = "`endotsr depth` makes it from the stereo pair" if clip.right else ONE_CAMERA
        file = clip.stated_in.name if clip.stated_in else ""
        if clip.right and not clip.baseline:
            remedy += f", once [camera] baseline, the distance between the two cameras, is stated in {file}"
        raise InputError(f"{clip.where}: no depth: [depth] is missing in {file}; {remedy}")
    return clip


def check_percentiles(config: SequenceConfig) -> None:
    """Raises InputError unless the depth percentiles are in [0, 100], one below and one above the median."""
    low, high = config.depth_percentiles
    if not enclose_median(low, high):
        raise InputError(f"depth_percentiles: ({low:g}, {high:g}): use {PERCENTILES}")


def _depth_percentiles(clip: Clip, config: SequenceConfig) -> tuple[SequenceConfig, list[str]]:
    """The settings, without a repeated clipping of depth; and the notes on what the clip states."""
    notes, depth = list(clip.notes), clip.depth
    assert depth is not None
    if clip.masks and clip.masks.origin:
        notes.append(f"masks: excluded pixels {clip.masks.origin}")
    if clip.masks and clip.masks.proposed:
        notes.append("masks: proposed by a program, not checked by a person")
    if depth.clipped and depth.clipped == tuple(config.depth_percentiles):
        config = msgspec.structs.replace(config, depth_percentiles=EVERYTHING)
        notes.append(f"depth: clipped to its percentiles {list(depth.clipped)} when it was resized, and not again")
    if depth.assumed:
        notes.append(f"{NOT_METRIC}{depth.method}; {KINDS['assumed-depth'].why}")
    return config, notes


def _allocated(clip: Clip, frames: range, config: SequenceConfig, notes: list[str]) -> tuple[Sequence, FrameStore]:
    """The sequence of these frames with empty arrays, and where they are. Raises InputError if they fit nowhere."""
    cameras, n = clip.cameras(frames), len(frames)
    width, height = cameras[0].width, cameras[0].height
    store = FrameStore(n, width, height, config.memory, clip.where)
    train, test = split_frames(n, config.split, config.block_length)
    sequence = Sequence(
        images=store.array((n, 3, height, width), np.uint8),
        masks=store.array((n, height, width), bool),
        depth=store.array((n, height, width), np.float32),
        times=normalised_times(None if clip.times is None else clip.times[list(frames)], n),
        cameras=cameras,
        names=[clip.names[i] for i in frames],
        unit=clip.unit_in_words,
        static_camera=cameras[0] is cameras[-1],
        train_index=train,
        test_index=test,
        notes=notes,
        duration=clip.duration(frames),
        not_read=clip.not_read,
    )
    return sequence, store


def _filled(sequence: Sequence, clip: Clip, frames: range, config: SequenceConfig, store: FrameStore) -> list[Facts]:
    """Read the files in several threads; returns the facts for the checks.

    Raises:  InputError naming the file of the first unusable frame.
    """
    n, height, width = sequence.masks.shape
    masks, depth = clip.masks, clip.depth
    assert depth is not None
    stored = store.array((n, height, width), np.uint8) if store.in_file and masks else None
    raw_masks, types = [sequence.depth] * n, [sequence.depth.dtype] * n
    facts: list[Facts | None] = [None] * n
    sized = partial(of_size, size=(width, height), said=clip.size_said)

    def read_frame(k: int) -> None:
        image, mask, prior = (files[frames[k]] if files else None for files in file_lists)
        assert image is not None and prior is not None
        picture = colour_picture(sized(read_picture(image), image), image)
        sequence.images[k] = picture.transpose(2, 0, 1)
        if mask:
            raw_masks[k] = _kept(grey_plane(sized(read_picture(mask), mask), mask), stored, k)
        raw = sized(read_plane(prior), prior)
        types[k] = raw.dtype
        plane = depth_plane(raw, depth.scale, prior)
        facts[k] = frame_facts(image.name, picture), depth_facts(prior.name, plane, raw, None)
        sequence.depth[k] = clip_depth(plane, config.depth_percentiles)

    file_lists = clip.images, masks.files if masks else [], depth.files
    in_threads(read_frame, n)
    check_depth_scale(sequence.depth, [depth.files[i] for i in frames], types, depth.unit)
    if masks:
        names = [str(masks.files[i]) for i in frames]
        tissue_masks(raw_masks, names, masks.excluded_value, sequence.notes, sequence.masks)
    else:
        sequence.masks[...] = True
    return [fact for fact in facts if fact is not None]


def _without_depth_outliers(sequence: Sequence, facts: list[Facts]) -> list[Facts]:
    """Remove the outliers of the prior depth in place, with a note; returns the facts with the usual limits."""
    if found := outlying_frames(far_limits([prior for _, prior in facts])):
        sequence.notes.append(remove_outliers(sequence.depth, found))
    usual = {outlying.frame: outlying.usual for outlying in found}
    return [(picture, prior._replace(limit=usual.get(k, prior.limit))) for k, (picture, prior) in enumerate(facts)]


def _without_twins(sequence: Sequence, facts: list[Facts], clip: Clip) -> Sequence:
    """The sequence without training frames that a held-out frame repeats, with a note. Raises InputError."""
    small = [picture.small for picture, _ in facts]
    pictures = picture_numbers(small, copied_frames(steps_between(small)))
    train, notes = without_twins(sequence.train_index, sequence.test_index, pictures, sequence.names, clip.where)
    sequence.notes.extend(notes)
    return replace(sequence, train_index=train)


def _kept(plane: NDArray, stored: NDArray[np.uint8] | None, i: int) -> NDArray:
    """The mask, or its copy in the array of the store if there is one and the mask has 8 bits."""
    if stored is None or plane.dtype != np.uint8:
        return plane
    stored[i] = plane
    return stored[i]


def _in_scene_units(sequence: Sequence, clip: Clip) -> Sequence:
    """The sequence in a world that float32 and the settings allow, with a note on the change."""
    centres = np.array([camera_centre(camera) for camera in sequence.cameras])
    world = fitting_world(centres, sequence.depth, clip.arbitrary)
    if world.unchanged:
        return sequence
    if world.scale != 1.0:
        np.multiply(sequence.depth, np.float32(world.scale), out=sequence.depth)
    sequence.notes.append(world_note(world, sequence.unit))
    return replace(sequence, cameras=moved_cameras(sequence.cameras, world))


def _mask_notes(sequence: Sequence, clip: Clip, config: SequenceConfig) -> list[str]:
    """The note on the masks: polarity, tissue fraction, evidence. Raises InputError for masks that seem inverted."""
    masks = clip.masks
    if masks is None:
        return [NO_MASKS]
    where, excluded, allow = masks.files[0].parent, masks.excluded_value, config.allow_tissue_fraction
    fraction = check_tissue_fraction(sequence.masks, str(where), excluded, allow)
    evidence = check_polarity(
        sequence.masks, sequence.depth, sequence.images, str(where), excluded, allow, masks.stated_in
    )
    return [f"{where.name}: {excluded} = excluded; tissue is {fraction:.1%} of the pixels; {evidence}"]


def _scaled(sequence: Sequence, size: tuple[int, int], clip: Clip, config: SequenceConfig) -> Sequence:
    """The sequence at `config.scale`, of this width and height, with a note."""
    scale, where, (width, height) = config.scale, str(clip.where), size
    if (width, height) == (sequence.width, sequence.height):
        sequence.notes.append(f"scale {scale:g} changes nothing: pictures of {width}x{height} pixels keep their size")
        return sequence
    sequence = smaller(sequence, width, height, config.memory, where)
    sequence.notes.append(f"scaled to {width}x{height}; tissue is {sequence.masks.mean():.1%} of the pixels")
    if clip.masks:
        at_scale = f"{clip.masks.files[0].parent} at scale {scale:g}"
        check_tissue_fraction(sequence.masks, at_scale, clip.masks.excluded_value, config.allow_tissue_fraction)
    return sequence
