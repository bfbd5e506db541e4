"""The related options of the commands: which ones exclude one another, and which ones need another.

Every option that another one makes pointless stands here; `parser.parse` refuses the combination with the reason.
`tests/cli/test_option_pairs.py` tries all pairs. In `prepare`, what a layout
reads of the statements on a source stands in its own module (`takes`).
"""

from endotsr.cli.parts.relations import Excludes, Needs, Relation

OF_PAIRS = ("nearest", "farthest", "block", "smooth", "no-smooth", "agreement", "confidence", "temporal")
OF_FILES = ("kind", "pairing", "unit-scale", "align", "farthest-over-nearest", "trust-depth")
OF_PAGE = ("keys", "title", "no-held-out", "sequence")
NOT_OF_PAGE = ("content", "times", "frames", "count", "opacity", "voxel", "without")
ONE_RUN = "the settings of a run are fixed"
RESIDUALS = ("model.appearance", "model.spectral-motion")
OF_MINUTES = (
    "training.iterations", "training.visits-per-frame", "training.coarse-start", "training.no-coarse-start",
    "density.growth", "density.maximum", "density.gradient-threshold", "initialisation.first-frame-points",
    "initialisation.other-frame-points",
)  # fmt: skip

# layout: of the source, stated or detected
PREPARE = (
    Excludes(
        ("camera", "field-of-view", "distortion"), ("calibration",),
        "a calibration file states intrinsics and distortion",
    ),
    Excludes(("camera",), ("field-of-view",), "both state the focal length"),
    Needs(
        ("distortion",), ("camera", "field-of-view"),
        "the coefficients belong to the intrinsics that are stated with them",
    ),
    Needs(
        ("trajectory-unit", "trajectory-direction", "trajectory-axes"),
        ("trajectory", *(f"layout={name}" for name in ("stereomis", "tum", "endonerf", "nerfstudio"))),
        "it describes the poses of this file",
    ),
    Excludes(("trajectory-axes",), ("layout=tum",), "the poses of this layout have the axes of OpenCV"),
    Needs(("excluded-value",), ("masks", "unite-masks"), "it describes the masks of these files"),
    Needs(("pairing",), ("masks", "unite-masks", "depth"), "it pairs these files with the frames"),
    Needs(("depth-unit", "depth-scale", "trust-depth"), ("depth",), "it describes the depth of these files"),
    Needs(("points",), ("layout=colmap", "layout=points"), "only a reconstruction has points"),
    Needs(("right",), ("layout=video", "layout=pictures"), "the other layouts have their own right pictures, or none"),
    Excludes(
        ("right",),
        tuple(f"stereo={half}{way}" for way in ("side_by_side", "stacked") for half in ("", "half_")),
        "each picture would hold two views already",
    ),
    Needs(("model",), ("layout=colmap",), "only COLMAP leaves several models"),
    Excludes(
        ("source-rate",),
        tuple(f"layout={name}" for name in ("common", "euroc", "scared", "servct", "tum")),
        "the layout states its times, or has none",
    ),
)  # fmt: skip
DEPTH = (
    Excludes(("flat",), ("given",), "a plane reads no files"),
    Needs(OF_FILES, ("given",), "it describes the files of another program"),
    Needs(
        ("align", "farthest-over-nearest"),
        ("kind=relative",),
        "only relative depth has a scale and a shift to fit",
    ),
    Needs(("trust-depth",), ("kind=relative", "kind=depth"), "disparities are not held against the pictures"),
    Excludes(("unit-scale",), ("kind=relative",), "the scale of relative depth is fitted or assumed"),
    Excludes(("given", "flat"), OF_PAIRS, "it sets the matching of stereo pairs"),
    Excludes(("no-smooth",), ("confidence",), "the confidence is that of the smoothing"),
)
MASKS = (
    Excludes(("draw",), ("out", "replace", "margin"), "the page writes no masks"),
    Excludes(("key-frames",), ("keys",), "the keys and the next frames are shown"),
    Needs(("key-frames",), ("draw",), "it is the number of frames of a page"),
    Needs(("margin",), ("keys",), "proposed masks have a margin of their own"),
    Needs(("layout",), ("out", "draw"), "without them SEQUENCE is a folder from prepare"),
)
TRAIN = (
    Excludes(
        ("calibrate-only",),
        ("config", "iterations", "minutes", "schedule", "effects", "windows", "resume"),
        ONE_RUN,
    ),
    Excludes(("calibrate-only",), ("no-evaluate", "lpips"), "it trains nothing and evaluates nothing"),
    Excludes(("resume",), ("minutes", "effects", "windows", "overlap", "chain"), ONE_RUN),
    Excludes(("minutes",), ("iterations",), "both set the length of the run"),
    Excludes(("minutes",), OF_MINUTES, "it chooses length, points and Gaussians"),
    Excludes(("minutes", "effects=auto"), ("windows",), "each window would get settings of its own"),
    Needs(("schedule",), ("iterations",), "only a stated length stretches the schedule"),
    Needs(("overlap", "chain"), ("windows",), "it describes the windows"),
    Needs(("workers", "scheduler"), ("windows", "resume"), "only windows are trained at the same time"),
    Excludes(("workers",), ("scheduler",), "the cluster has its own workers"),
    Excludes(("json", "lpips"), ("no-evaluate",), "there are no metrics to write"),
)
# Settings on the command line that others switch off. A preset or a file may hold them all.
SETTINGS = (
    Needs(("model.beta", "optimiser.appearance-factor"), ("model.appearance",), "it belongs to component A"),
    Needs(
        ("model.correlation-length", "loss.lambda-msp", "optimiser.spectral-motion-factor", "initialisation.motion"),
        ("model.spectral-motion",),
        "it belongs to component S",
    ),
    Needs(
        ("model.frequencies", "model.frequency-min", "model.frequency-max", "training.residual-activation",
         "optimiser.restart-residual-schedule", "optimiser.no-restart-residual-schedule"),
        RESIDUALS,
        "it belongs to the components A and S",
    ),
    Needs(
        ("loss.lambda-lap", "loss.laplacian-from", "loss.laplacian-full", "loss.upsampling"),
        ("model.laplacian",),
        "it belongs to component L",
    ),
    Needs(
        ("loss.gradient-ratio", "loss.calibration-views"),
        ("loss.lambda-lap=auto",),
        "it belongs to the calibration of this weight",
    ),
    Needs(
        ("model.basis", "model.bases", "model.initial-width", "optimiser.deformation-position-factor"),
        ("model.deformation",),
        "it belongs to the deformation model",
    ),
    Needs(("optimiser.deformation",), ("model.deformation", *RESIDUALS), "it is the rate of deformation and residuals"),
    Needs(("optimiser.exposure",), ("model.exposure",), "it is the rate of the exposures"),
    Needs(("optimiser.pose",), ("model.pose-correction",), "it is the rate of the corrections of poses"),
    Needs(
        ("optimiser.harmonics-rest", "training.harmonics-interval"),
        ("model.harmonics-degree",),
        "degree 0 has no further harmonics",
    ),
    Needs(
        ("loss.total-variation-factor", "loss.smoothness-from"),
        ("loss.smoothness-weight",),
        "it belongs to the smoothness terms",
    ),
    Needs(("density.gradient-threshold",), ("density.growth=threshold",), "a budget has no threshold"),
    Excludes(("optimiser.annealing-from",), ("optimiser.annealed-factor=1.0",), "a factor of 1 anneals nothing"),
    Needs(
        ("sequence.block-length",), ("sequence.split=blocks", "sequence.split=end"), "the other splits have no blocks"
    ),
    Excludes(("sequence.excluded-value",), ("sequence.masks=none",), "no mask is read"),
    Needs(
        ("initialisation.motion-threshold",),
        ("initialisation.other-frame-points",),
        "it selects points of the other frames",
    ),
)  # fmt: skip
RENDER = (
    Excludes(("times", "frames", "count"), ("times", "frames", "count"), "each of them chooses the times"),
    Excludes(("rate",), ("slow",), "both set the speed of the film"),
    Needs(("rate", "slow", "panels"), ("film",), "it describes a film"),
    Needs(("npy",), ("out",), "arrays are written to the folder of the pictures"),
    Needs(("depth",), ("out", "panels=depth"), "neither pictures of depth nor a panel of depth is written"),
    Needs(("angle",), ("camera=orbit", "camera=sway"), "the other cameras do not turn"),
    Needs(("sequence",), ("panels=truth", "panels=error", "texture"), "nothing else reads the frames of the sequence"),
    Needs(("texture",), ("camera=observed",), "the frames show the views of the recording alone"),
    Excludes(("texture",), ("offset", "size"), "the frames show the views of the recording alone (--camera observed)"),
    Needs(("texture",), ("out", "panels=render", "panels=error"), "no colour is written"),
)
# format: of --out, by its ending
EXPORT = (
    Excludes(("times", "frames", "count"), ("times", "frames", "count"), "each of them chooses the times"),
    Excludes(("format=page",), NOT_OF_PAGE, "a page contains all times and the whole scene"),
    Excludes(("format=slim model",), NOT_OF_PAGE, "a slim model stores all times and the whole scene"),
    Excludes(("format=animated points",), ("content", "voxel"), "a .glb file stores animated points"),
    Needs(OF_PAGE, ("format=page",), "it describes a page"),
    Excludes(("no-held-out",), ("sequence",), "without held-out frames the sequence is not read"),
    Needs(("opacity",), ("content=points", "format=animated points"), "it selects points"),
    Needs(("voxel",), ("content=mesh",), "it is the resolution of a mesh"),
)
# run: of windows, if METHOD is one; otherwise "of one training"
COMPARED = ("methods>1", "compare")
EVALUATE = (
    Needs(("compare",), ("methods>0",), "they are run folders, JSON files or folders of pictures to compare"),
    Excludes(("pictures", "label", "measures"), COMPARED, "evaluate one method alone first"),
    Excludes(("no-view",), (*COMPARED, "pictures", "run=of windows"), "no view.html is written"),
    Needs(("seed", "no-baselines"), COMPARED, "it describes a comparison"),
    Needs(("label",), ("pictures",), "a comparison takes NAME=PATH"),
    Excludes(("measures",), ("pictures", "run=of windows"), "measures render views of a run of one training"),
    Excludes(("sequence.*",), ("methods>0",), ONE_RUN, unless=COMPARED),
)
# folder: with a measurement, if --budget chooses from it
TRADEOFF = (
    Excludes(("run",), ("splats",), "both state the scene"),
    Needs(("json",), ("budget",), "it is the answer to a budget; the measurement itself is tradeoff.json in DIR"),
    Excludes(
        ("run", "splats", "scale", "threads"),
        ("folder=with a measurement",),
        "--budget chooses from it; another --out makes a new one",
    ),
)

RELATIONS: dict[str, tuple[Relation, ...]] = {
    "prepare": PREPARE,
    "depth": DEPTH,
    "masks": MASKS,
    "train": (*TRAIN, *(relation._replace(unless=("resume", "calibrate-only")) for relation in SETTINGS)),
    "render": RENDER,
    "export": EXPORT,
    "evaluate": EVALUATE,
    "tradeoff": TRADEOFF,
    "golden run": (Needs(("name",), ("certificate",), "it is the name of the port in the certificate"),),
}
# Of a command: follows from its options, and the command checks it.
FACTS = {"prepare": "layout", "export": "format", "evaluate": "run", "tradeoff": "folder"}
