"""The kinds of findings of `endotsr check`, each with level, reason and remedy.

The code of a kind is its name in `--json` and is stable across versions.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeVar

from endotsr.errors import InputError

Level = Literal["refusal", "warning", "note"]
T = TypeVar("T")

REFUSED = "training refuses it"
LEAVE_OUT = "leave the frame out: endotsr prepare CLIP --out CLIP --replace --drop FRAME"
ONE_CAMERA = (
    "one camera: endotsr depth --given FILES --kind relative (inverse depth of a network, not metric), for a clip with"
    " poses --kind depth in their unit, a COLMAP model,"
    " endotsr poses --sfm for a moving camera, or endotsr depth --flat"
)
SMALLER = "endotsr prepare --scale 0.5, or fewer --frames"


class Kind(NamedTuple):
    """One kind of finding. `endotsr train` also refuses what is a refusal here, but for `inverted-depth`, and for
    `pose-convention` in a folder that `prepare` wrote."""

    level: Level
    why: str
    remedy: str


KINDS: dict[str, Kind] = {
    # files
    "sequence-file": Kind("refusal", "sequence.toml defines the meaning of the files", "correct the key"),
    "images-files": Kind("refusal", "training reads them", "supply the images, one file per frame"),
    "masks-files": Kind("refusal", "training reads them", "supply the masks, one file per frame"),
    "depth-files": Kind("refusal", "training reads them", "supply the depth, one file per frame"),
    "pairing": Kind("refusal", REFUSED, "supply the file, or omit the frame: delete its files in all folders, and its"
                    " row in poses_bounds.npy"),
    "size": Kind("refusal", "all files of a sequence have one size", "export it again"),
    "frames": Kind("refusal", REFUSED, "more frames, or another split"),
    "picture-size": Kind("refusal", REFUSED, "another endotsr prepare --scale or --sequence.scale"),
    "number-gap": Kind("warning", "frames count as evenly spaced in time",
                       "supply the missing frames, or cut the clip there"),
    "order-of-names": Kind("warning", "frames are in the order of the numbers in their names",
                           "put the date before the time and write hours from 0 to 23, or number the frames"),
    "not-read": Kind("note", "training knows nothing of it",
                     "none needed for files of other programs; endotsr prepare has options that read such files"),
    "frame-rate": Kind("warning", "times may be in milliseconds, or the time between two frames may stand for the rate",
                       "state times in seconds, and frame_rate in frames per second"),
    "uneven-times": Kind("note", "training uses the times in sequence.toml", "none needed"),
    # pictures
    "picture": Kind("refusal", REFUSED, f"copy or export the file again, or {LEAVE_OUT}"),
    "no-picture": Kind("refusal", "there is nothing to reconstruct",
                       "inspect the pictures, and decode or export them again"),
    "constant-clip": Kind("refusal", "nothing moves, and every held-out frame is a copy of a training frame",
                          "inspect the pictures: a frozen video, or one picture under many names"),
    "black-frame": Kind("warning", "a black frame teaches the model a black scene at its time", LEAVE_OUT),
    "white-frame": Kind("warning", "a white frame teaches the model a white scene at its time", LEAVE_OUT),
    "interlaced-pictures": Kind("warning", "each picture seems to combine two moments, as interlaced video does, or two"
                                " views, as 3-D video does that has them in turn by rows or columns",
                                "prepare the video itself, or deinterlace it before exporting pictures; of 3-D video,"
                                " export each view"),
    "dark-border": Kind("warning", "training fits black tissue there",
                        "crop the clip (endotsr prepare --crop), or exclude the border (--border exclude)"),
    "clipped-frame": Kind("warning", "colour is lost there", LEAVE_OUT),
    "duplicated-frame": Kind("warning", "the motion stops there, and training leaves out a frame that a held-out"
                             " frame repeats", LEAVE_OUT),
    "repeated-frames": Kind("warning", "the motion stops and jumps, and training leaves out every frame that a held-out"
                            " frame repeats",
                            "prepare the clip again with the --frames that are named"),
    "blended-frames": Kind("warning", "they show two moments at once, as programs make them that double a frame rate",
                           "prepare the clip again with the --frames that are named"),
    "returning-frames": Kind("warning", "time goes on where the picture goes back, as in a clip that is joined to"
                             " itself or played back and forth; training leaves out every frame that a held-out frame"
                             " repeats",
                             "prepare each picture once: endotsr prepare --frames"),
    "exchanged-frames": Kind("warning", "the motion goes back and forth there, and a held-out frame stands between"
                             " frames of other times",
                             "give the pictures the numbers of their times, with masks and depth of the same frames"),
    "frame-order": Kind("warning", "frames count as evenly spaced in time in the order of their names, and motion goes"
                        " back and forth where they are not",
                        "give the pictures the numbers of their times, with leading zeros in the program that wrote"
                        " them, and masks and depth those of their pictures"),
    "blurred-frame": Kind("warning", "out of focus or blurred by motion, it teaches the model a blurred scene at its"
                          " time", LEAVE_OUT),
    "flicker": Kind("warning", "the colour of the tissue follows the light or the exposure of the camera",
                    "fit exposures (model.exposure = true); record with the shutter in step with the light"),
    "exposure-jump": Kind("warning", "the colour of the tissue follows the camera there",
                          "fit exposures (model.exposure = true), or cut the clip with --frames"),
    "colour-jump": Kind("warning", "another light, white balance or kind of picture begins or ends there, or something"
                        " grey covers the view, and training fits one colour to the tissue",
                        f"cut the clip there: endotsr prepare --frames; or {LEAVE_OUT}; none needed where masks exclude"
                        " what covers the view"),
    "plain-frame": Kind("warning", "a part that was not decoded, or was painted over, becomes tissue at its time",
                        f"decode or export it again; or {LEAVE_OUT}"),
    "another-scene": Kind("warning", "training fits one scene, and the parts before and after a cut are unrelated",
                          "cut the clip there: endotsr prepare --frames; or train it with --windows auto"),
    "zoom-jump": Kind("warning", "the focal length changes there, by a digital zoom or another size of the picture, and"
                      " training has one camera",
                      "cut the clip there: endotsr prepare --frames; the calibration holds for one of the parts"),
    "two-views": Kind("warning", "a stereo pair in one picture is not one view",
                      "state it: endotsr prepare --stereo side_by_side or stacked"),
    "alternating-views": Kind("warning", "two alternating cameras or kinds of light are not one scene",
                              "prepare each separately: --frames ::2, and --frames 1::2"),
    "shifted-colours": Kind("warning", "the colour planes show two views, as in an anaglyph, or two moments, as of a"
                            " camera that takes the colours one after another, and training fits one view to all",
                            "export each view in its colours; for planes of other moments, move them into one place"
                            " before the pictures are written"),
    "straight-border": Kind("warning", "two pictures in one, bars that are not black and the display of a console are"
                            " not one view of one scene",
                            "cut the picture out: endotsr prepare --crop; or exclude the rest: --unite-masks"),
    "plain-part": Kind("warning", "a surround or panel of one colour is no tissue, and training fits it as such",
                       "exclude it: endotsr prepare --unite-masks FILE with a mask of it; or cut it off with --crop"),
    "burnt-in": Kind("warning", "training fits it as tissue that travels with the camera",
                     "exclude it: endotsr prepare --unite-masks FILE with a mask of it; or cut a row of text off with"
                     " --crop"),
    "same-views": Kind("warning", "equal views have no parallax, and a depth of them is no measurement",
                       "export the right view again"),
    "exchanged-views": Kind("warning", "in a rectified pair points lie farther left in the right view, where stereo"
                            " matching searches: left and right are exchanged, both views are mirrored, or their"
                            " principal points differ",
                            "store the left pictures in images/ and the right ones in images_right/, with masks and"
                            " depth of the left ones; of a recording, prepare it with the calibration of both cameras:"
                            " --calibration FILE"),
    "frozen-right-view": Kind("warning", "depth from such a pair joins two moments",
                              "record or export the right view again, or leave these frames out: endotsr prepare"
                              " --drop"),
    "late-right-view": Kind("warning", "depth from such a pair joins two moments, and tissue that moves gets a"
                            " wrong one",
                            "join pairs of one moment: endotsr prepare --right-late N; -N for an early view"),
    "unequal-views": Kind("warning", "stereo matching compares the brightness of both views, and finds little or wrong"
                          " depth",
                          "export both views with one exposure and one range; if a camera is darker, brighten its"
                          " pictures by one factor"),
    "unrectified-views": Kind("warning", "stereo matching searches along the rows, and depth is missing or wrong where"
                              " they differ",
                              "prepare the recording with the calibration of both cameras: --calibration FILE"),
    "blue-pictures": Kind("warning", "tissue is red: red and blue may be exchanged, as OpenCV stores them",
                          "export the pictures again as RGB; none needed for blue light"),
    "negative-pictures": Kind("warning", "tissue is red, and bright where it is near: these may be negatives, 255 - x",
                              "export the pictures again; none needed for green or blue light"),
    "colour-profile": Kind("note", "its values are read as sRGB: colours differ from those in a viewer",
                           "convert the pictures to sRGB where colours matter"),
    "grey-pictures": Kind("note", "polarity cannot be checked by colour", "none needed"),
    # masks
    "no-masks": Kind("note", "instruments count as tissue",
                     "supply masks (endotsr prepare --masks), or propose them (endotsr masks)"),
    "proposed-masks": Kind("note", "instruments that the proposal misses become tissue, and the masks have not"
                           " been inspected",
                           "inspect proposed_masks.png"),
    "mask": Kind("refusal", REFUSED, f"export the mask again, or {LEAVE_OUT}"),
    "mask-values": Kind("refusal", REFUSED, "store two values"),
    "tissue-fraction": Kind("refusal", REFUSED, "set the excluded value as stated, or correct the masks"),
    "polarity": Kind("refusal", REFUSED, "set the excluded value as stated, or correct the masks"),
    "inverted-masks": Kind("warning", "with the wrong reading, training fits the instruments and hides the tissue",
                           "read them the other way: endotsr prepare SOURCE --masks FOLDER --excluded-value black"),
    "frame-without-tissue": Kind("warning", "it contributes nothing to the training, and its tissue metrics are"
                                 " undefined",
                                 "inspect its mask; leave the frame out if the mask is right"),
    "nothing-to-train": Kind("refusal", REFUSED,
                             "check masks and depth of these frames, or choose another --sequence.split"),
    "nothing-to-evaluate": Kind("warning", "every metric and comparison is undefined",
                                "inspect their masks, or choose another --sequence.split"),
    "single-mask": Kind("refusal", REFUSED, "correct this mask"),
    "exchanged-masks": Kind("warning", "the masks hide tissue and show the instrument there",
                            "give each mask the number of its picture"),
    "flipped-masks": Kind("warning", "the masks hide tissue and show the instrument",
                          "store their first row at the top and their first column at the left, like the picture"),
    "turned-masks": Kind("warning", "one part of the masks hides the tissue and shows the instrument",
                         "invert the masks of one part, so that all have one polarity"),
    "late-masks": Kind("warning", "the masks show the instrument and hide tissue along the path of the instrument",
                       "move them: endotsr prepare --masks-late N, -N for early masks; or give each mask the number of"
                       " its picture"),
    "unlike-mask": Kind("warning", "it excludes tissue that its neighbours show, or shows what they exclude, and a"
                        " held-out frame there is measured on pixels that training hardly sees",
                        f"inspect its mask; if it is wrong, correct it or {LEAVE_OUT}"),
    "held-masks": Kind("warning", "an instrument moves while its mask stays, and the training reads it as tissue",
                       "supply a mask for each frame, or give the drawn ones to endotsr masks --keys FOLDER, which"
                       " carries them to the others"),
    "speckled-masks": Kind("warning", "noise hides tissue all over the picture and leaves parts of the instrument in"
                           " the training",
                           "remove it by a median or an opening of the masks, as cv2.medianBlur(mask, 5), or smooth"
                           " the picture before its threshold"),
    # depth
    "no-depth": Kind("refusal", "nothing can be placed in space",
                     f"a stereo pair: endotsr depth; {ONE_CAMERA}; empty files: check their scale"),
    "assumed-depth": Kind("warning", "lengths and other viewpoints are not measurements",
                          "take scale and shift from points of a reconstruction, or from a stereo pair"),
    "depth-file": Kind("refusal", REFUSED, f"export the depth again, or {LEAVE_OUT}"),
    "depth-values": Kind("refusal", REFUSED, "store lengths"),
    "frame-without-depth": Kind("note", "the initialisation ignores it", "none needed if these are few"),
    "little-depth": Kind("warning", "the scene is initialised only where there is depth",
                         "another stereo method, or wider ranges"),
    "near-plane": Kind("warning", "tissue in front of the near plane is not drawn", "check the unit of the depth"),
    "depth-unit": Kind("warning", "learning rates and thresholds are in millimetres",
                       "state the unit: prepare --depth-unit and --depth-scale, or [depth] in sequence.toml"),
    "depth-far-off": Kind("warning", "the depth of this frame may be in another unit or normalised",
                          "write all frames with one scale"),
    "depth-outliers": Kind("warning", "the depth loss divides by the largest depth of a frame: a few wrong far depths"
                           " change it in the whole frame",
                           "remove them: sequence.depth_outliers = removed, as in every preset but paper"),
    "metres-cut": Kind("refusal", "metres were truncated to whole numbers",
                       "store millimetres, or a smaller step with its scale"),
    "marked-depth": Kind("warning", "the value seems to mark pixels without depth but is read as a distance",
                         "store 0 where there is no depth"),
    "wrapped-depth": Kind("warning", "the numbers did not fit the type of the files and begin again at 0: the depth has"
                          " steps that the tissue does not have",
                          "store the depth in 16 bits, or in larger units such as whole millimetres"),
    "blended-depth": Kind("warning", "depth was resized with interpolation, which makes depths of 0 and of tissue into"
                          " depths in front of it",
                          "resize depth without interpolation, or give endotsr depth --given the files in their own"
                          " size"),
    "still-depth": Kind("note", "the shape of the tissue comes from one moment",
                        "none needed if the scene rests; else supply one file of depth for each frame"),
    "depth-own-scale": Kind("warning", "every frame pulls the tissue to another distance: the depth of each frame may"
                            " be normalised on its own",
                            "store lengths with one scale for all frames; relative depth of a network: endotsr depth"
                            " --given FOLDER --kind relative --align frame"),
    "depth-scale-jump": Kind("warning", "the tissue jumps to another distance there: the depth may come in parts, each"
                             " with a scale of its own, or one frame may have another scale",
                             "store lengths with one scale for all frames; relative depth of a network: endotsr depth"
                             f" --given FOLDER --kind relative --align frame; for one frame: {LEAVE_OUT}"),
    "constant-depth": Kind("refusal", "the scene would be a flat board", "supply measured depth"),
    "normalised-depth": Kind("warning", "each frame looks stretched to the full range, so its values are not"
                             " lengths", "store lengths with one scale for all frames"),
    "coarse-depth": Kind("warning", "surfaces become steps", "store 16 bits with a smaller step"),
    "inverted-depth": Kind("refusal", "near and far are exchanged: the file contains disparity, or an inverted picture",
                           "read it as disparity: endotsr depth --given FOLDER --kind disparity"),
    "depth-against-light": Kind("warning", "the light is on the scope, which makes near tissue brighter: the file may"
                                " hold disparity or an inverse depth, or be mirrored or upside down",
                                "read a disparity as such: endotsr depth --given FOLDER --kind disparity"),
    "depth-against-pair": Kind("warning", "one of them is wrong: the depth, the baseline or the focal length",
                               "state the unit of the depth: prepare --depth-unit and --depth-scale; export depth along"
                               " the optical axis, without an offset; or endotsr depth CLIP --replace"),
    "late-depth": Kind("warning", "the tissue that moves gets the depth of another moment",
                       "give each file of depth the number of its picture"),
    "displaced-depth": Kind("warning", "the tissue gets the depth of what lies beside it",
                            "cut depth, masks and pictures to one window and one size, or move the depth by these"
                            " pixels"),
    "flipped-depth": Kind("warning", "the depth does not match the tissue in the picture",
                          "store its first row at the top and its first column at the left, like the picture"),
    # cameras
    "cameras": Kind("refusal", REFUSED, f"correct the poses; for one frame: {LEAVE_OUT}"),
    "distortion": Kind("refusal", "the model is a pinhole camera", "undistort the pictures with endotsr prepare"),
    "field-of-view": Kind("warning", "the focal length may belong to another picture size or be in millimetres",
                          "state the focal length in pixels of these pictures"),
    "principal-point": Kind("warning", "the calibration may belong to another picture size", "check width and height"),
    "pixel-shape": Kind("warning", "pixels are rarely so elongated; the pictures may have been stretched",
                        "check the calibration against the picture size"),
    "baseline-unit": Kind("warning", "depth from the pairs has the scale of the baseline",
                          "state it in millimetres: prepare --baseline, or T of a calibration; or with the unit of"
                          " sequence.toml"),
    "pose-jump": Kind("warning", "one wrong pose blurs the whole scene", f"check this pose, or {LEAVE_OUT}"),
    "repeated-pose": Kind("note", "a tracker that loses the scope may repeat its last pose, or write the identity",
                          "none needed if the scope rests there; else leave these frames out: endotsr prepare --drop"),
    "pose-turn": Kind("warning", "such a turn between neighbouring frames is most likely a wrong pose",
                      "check axes and direction of the trajectory"),
    "pose-unit": Kind("warning", "poses and depth may be in different units, such as metres and millimetres",
                      "state the unit: prepare --trajectory-unit"),
    "pose-convention": Kind("refusal", "with the poses as they were read, training fits another path",
                            "read or write the poses as named"),
    "pose-mismatch": Kind("warning", "every frame pulls the scene to another place",
                          "check poses, depth, intrinsics and times; endotsr poses --replace estimates poses"),
    "pose-doubtful": Kind("note", "poses or depth are inaccurate, or the tissue moves as much as the scope",
                          "compare with endotsr poses, or fit the poses (model.pose_correction = true)"),
    "far-from-origin": Kind("note", "float32 is too coarse there", "none needed: the world is moved"),
    # cost
    "disk": Kind("refusal", REFUSED, SMALLER),
    "frames-in-file": Kind("note", "that is more than half of sequence.memory", "none needed"),
    "memory": Kind("warning", "training would run out of memory",
                   "endotsr prepare --scale 0.5, or a smaller --sequence.memory"),
}  # fmt: skip


class Finding(NamedTuple):
    """One result of a check."""

    level: Level
    code: str  # key of `KINDS`
    where: str  # file or folder
    frame: int | None  # number within the sequence, from 0
    what: str
    why: str
    remedy: str

    @property
    def line(self) -> str:
        """The finding in one line."""
        place = f"{self.where}, frame {self.frame}" if self.frame is not None else self.where
        what = self.what.removeprefix(f"{self.where}: ")  # the text of an error begins with its file
        return f"{place}: {what}; {self.why}; {self.remedy}"


def finding(code: str, where: object, what: str, frame: int | None = None) -> Finding:
    """A finding of a kind in `KINDS`, for a file or folder and optionally a frame."""
    kind = KINDS[code]
    return Finding(kind.level, code, str(where), frame, what, kind.why, kind.remedy)


def tried(
    findings: list[Finding], make: Callable[[], T], code: str, where: object, frame: int | None = None
) -> T | None:
    """The value that a reader makes; None if it raises InputError, whose text becomes one more finding."""
    try:
        return make()
    except InputError as error:
        findings.append(finding(code, where, " ".join(str(error).split()), frame))
        return None


def worst_first(findings: list[Finding]) -> list[Finding]:
    """Refusals, then warnings, then notes; each in the order found."""
    order = {"refusal": 0, "warning": 1, "note": 2}
    return sorted(findings, key=lambda found: order[found.level])
