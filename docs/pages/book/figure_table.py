"""Every figure of the prose by the name that its mark has: `39.83 dB<!--=flow.tissue-->`, see `figures`."""

from collections.abc import Callable
from operator import sub
from typing import NamedTuple


class Figure(NamedTuple):
    """The mean of one number of several records."""

    records: str  # pattern of files of docs/results
    path: str
    """Keys, and indices or `key=value` of a list, joined by dots; `*` is the mean over a list, and `*key=value` the
    mean over its entries with this value."""
    form: str
    scale: float = 1.0


class Setting(NamedTuple):
    """A constant of the code."""

    name: str  # MODULE:NAME, with attributes and indices joined by dots
    form: str = "{:.0f}"
    scale: float = 1.0


class Formula(NamedTuple):
    """A function of other figures."""

    of: Callable[..., float]
    keys: tuple[str, ...]
    form: str


MIB = 1 / 2**20
PULLING, SHARP = "pulling_paper_seed0.json", "pulling_sharp_seed?.json"
PAPER = "pulling_paper_seed?.json"
ALONE = "clips.endonerf_pulling.every eighth frame.baselines"
CUTTING = "clips.endonerf_cutting.every eighth frame.baselines"
BLOCKS8, BLOCKS16 = "clips.endonerf_pulling.blocks of 8 frames.baselines", "pulling_sharp_blocks16_seed?.json"
CLAMPED = "tradeoff_cutting_sharp.json"
TRUTH, PULL = "effects_truth.json", "scenes.pull and breath"
VIEWS, WITHOUT, OF_SHARP = "sweeps/other_views.json", "other_views.json", "rows.*configuration=sharp.measures"
MODEL, MOVED = "rows.label=this model", "rows.label=left picture moved by the prior depth"
FLOW = "rows.label=flow between the neighbours, moved by the blend of their depths"
BLEND = "rows.label=blend of the neighbouring priors"
WAITED = "rows.clip=endonerf_pulling&clock=wall&cold=False&register_bytes=64&processor=AMD EPYC&preset={}.whole"
WAITED_MOST = "rows.clip=endonerf_pulling&clock=wall&cold=False&processor=Intel(R) Xeon(R) Processor&preset={}.whole"
FIGURES: dict[str, Figure | Setting | Formula] = {
    "wait.quick": Figure("waiting.json", WAITED.format("quick"), "{:.1f}", 1 / 60),
    "wait.sharp": Figure("waiting.json", WAITED.format("sharp"), "{:.1f}", 1 / 60),
    "wait.quick.most": Figure("waiting.json", WAITED_MOST.format("quick"), "{:.1f}", 1 / 60),
    "flow.tissue": Figure(PULLING, "baselines.flow_interpolation.mean.psnr_tissue", "{:.2f}"),
    "blend.tissue": Figure(PULLING, "baselines.two_neighbours.mean.psnr_tissue", "{:.2f}"),
    "sharp.tissue": Figure(SHARP, "held_out.mean.psnr_tissue", "{:.2f}"),
    "paper.tissue": Figure(PAPER, "held_out.mean.psnr_tissue", "{:.2f}"),
    "blend.full.pulling": Figure("interpolation.json", f"{ALONE}.two_neighbours.psnr_full", "{:.2f}"),
    "blend.full.cutting": Figure("interpolation.json", f"{CUTTING}.two_neighbours.psnr_full", "{:.2f}"),
    "flow_tissue.pulling": Figure("interpolation.json", f"{ALONE}.flow_interpolation_tissue.psnr_tissue", "{:.2f}"),
    "flow.cutting": Figure("interpolation.json", f"{CUTTING}.flow_interpolation.psnr_tissue", "{:.2f}"),
    "blend.cutting": Figure("interpolation.json", f"{CUTTING}.two_neighbours.psnr_tissue", "{:.2f}"),
    "flow_tissue.cutting": Figure("interpolation.json", f"{CUTTING}.flow_interpolation_tissue.psnr_tissue", "{:.2f}"),
    "sharp.cutting": Figure("cutting_sharp_seed?.json", "held_out.mean.psnr_tissue", "{:.2f}"),
    "sharp.cutting.lpips": Figure("cutting_sharp_seed?.json", "held_out.mean.lpips", "{:.4f}"),
    "flow.cutting.lpips": Figure("cutting_sharp_seed?.json", "baselines.flow_interpolation.mean.lpips", "{:.4f}"),
    "rife.tissue": Figure("network.json", f"{ALONE}.network.psnr_tissue", "{:.2f}"),
    "rife.lpips": Figure("network.json", f"{ALONE}.network.lpips", "{:.4f}"),
    "rife.cutting": Figure("network.json", f"{CUTTING}.network.psnr_tissue", "{:.2f}"),
    "rife.cutting.lpips": Figure("network.json", f"{CUTTING}.network.lpips", "{:.4f}"),
    "paper.below_blend": Formula(sub, ("blend.tissue", "paper.tissue"), "{:.1f}"),
    "sharp.paths": Figure("levers.json", "scenes.demo.`sharp`.*.scene_units", "{:.2f}"),
    "paper.paths": Figure("levers.json", "scenes.demo.`paper`.*.scene_units", "{:.2f}"),
    "tissue.paths": Figure("levers.json", "scenes.demo.`paper`.*.motion_scene_units", "{:.2f}"),
    "flow.paths": Figure("levers.json", "chain.scenes.demo.scene_units", "{:.2f}"),
    "sharp.paths.pull": Figure("levers.json", f"{PULL}.`sharp`.*.scene_units", "{:.2f}"),
    "paper.paths.pull": Figure("levers.json", f"{PULL}.`paper`.*.scene_units", "{:.2f}"),
    "tissue.paths.pull": Figure("levers.json", f"{PULL}.`paper`.*.motion_scene_units", "{:.2f}"),
    "flow.paths.pull": Figure("levers.json", "chain.scenes.pull and breath.scene_units", "{:.2f}"),
    "truth.sharp.depth": Figure(TRUTH, "scenes.motion.`sharp`.*.depth_mm", "{:.2f}"),
    "truth.paper.depth": Figure(TRUTH, "scenes.motion.`paper`.*.depth_mm", "{:.2f}"),
    "truth.sharp.still": Figure(TRUTH, "scenes.light.`sharp`.*.scene_units", "{:.2f}"),
    "truth.paper.still": Figure(TRUTH, "scenes.light.`paper`.*.scene_units", "{:.2f}"),
    "biker.largest": Figure("tradeoff_biker.json", "points.0.error.max", "{:.2f}"),  # of `paper`
    "cutting.paper": Figure(CLAMPED, "points.name=paper.error.rms", "{:.2f}", 255),
    "cutting.unclamped": Figure(CLAMPED, "points.name=float32, cutoff 1/255, stop 1e-4.error.rms", "{:.2f}", 255),
    "cutting.stop": Figure(CLAMPED, "points.name=float64, cutoff 1e-12, stop 1e-4.error.max", "{:.0f}", 255),
    "cutting.cutoff": Figure(CLAMPED, "points.name=alpha cutoff 1/255.error.max", "{:.0f}", 255),
    "cutting.alpha": Figure(CLAMPED, "points.79.error.rms", "{:.3f}", 255),  # alpha clamp 0.99
    "right.baseline": Figure(WITHOUT, "measures.right_view.baseline", "{:.1f}"),
    "right.rows": Figure(WITHOUT, "rows_apart", "{:.1f}"),
    "right.sharp": Figure(VIEWS, f"{OF_SHARP}.right_view.{MODEL}.held_out_psnr", "{:.2f}"),
    "right.sharp.training": Figure(VIEWS, f"{OF_SHARP}.right_view.{MODEL}.training_psnr", "{:.2f}"),
    "right.moved": Figure(WITHOUT, f"measures.right_view.{MOVED}.held_out_psnr", "{:.2f}"),
    "right.moved.training": Figure(WITHOUT, f"measures.right_view.{MOVED}.training_psnr", "{:.2f}"),
    "right.flow": Figure(WITHOUT, f"measures.right_view.{FLOW}.held_out_psnr", "{:.2f}"),
    "right.depth": Figure(VIEWS, f"{OF_SHARP}.depth.{MODEL}.mean_absolute", "{:.2f}"),
    "right.depth.blend": Figure(WITHOUT, f"measures.depth.{BLEND}.mean_absolute", "{:.2f}"),
    "truth.paper.light": Figure(TRUTH, "scenes.light.`paper`.*.depth_mm", "{:.3f}"),
    "truth.still.light": Figure(TRUTH, "scenes.light.`paper` without S.*.depth_mm", "{:.3f}"),
    "sharp.blocks16": Figure(BLOCKS16, "held_out.mean.psnr_tissue", "{:.2f}"),
    "sharp.fade16": Figure(BLOCKS16, "cross_fade.mean.psnr_tissue", "{:.2f}"),
    "sharp.blocks8": Figure("pulling_sharp_blocks8_seed?.json", "held_out.mean.psnr_tissue", "{:.2f}"),
    "rife.blocks8": Figure("network.json", f"{BLOCKS8}.network.psnr_tissue", "{:.2f}"),
    "flow.frame1": Figure(PULLING, "baselines.flow_interpolation.per_frame.0.psnr_tissue", "{:.2f}"),
    "workload.focal": Setting("endotsr.training.scene.workload:FOCAL"),
    "diverged.rise": Setting("endotsr.training.fitting.divergence:RISE"),
    "diverged.far": Setting("endotsr.training.fitting.divergence:FAR_OFF_FRACTION", scale=100),
    "memory.assumed": Setting("endotsr.method.kernels.memory:ASSUMED", scale=1e-9),
    "limit.picture": Setting("endotsr.untrusted.png:LARGEST_FILE", scale=MIB),
    "limit.text": Setting("endotsr.untrusted.files:LARGEST_TEXT", scale=MIB),
    "limit.settings": Setting("endotsr.untrusted.toml:LARGEST_FILE", scale=MIB),
    "limit.colmap": Setting("endotsr.clips.formats.colmap_model:LARGEST_FILE", scale=MIB / 1024),
    "limit.checkpoint": Setting("endotsr.training.fitting.checkpoint:LARGEST", scale=MIB / 1024),
    "report.preview": Setting("endotsr.results.views.preview:PREVIEW_BYTES", "{:.1f}", 1e-6),
    "kill.least": Setting("endotsr.training.runs.training:FEWEST_SECONDS"),
    "kill.most": Setting("endotsr.training.runs.training:MOST_SECONDS", scale=1 / 60),
    "kill.patience": Setting("endotsr.training.runs.stopping:PATIENCE", form="{:.1f}"),
    "kill.share": Setting("endotsr.training.runs.training:LARGEST_LOSS", scale=100),
    "kill.cost": Setting("endotsr.training.runs.training:LARGEST_FRACTION", scale=100),
    "depth.farther": Setting("endotsr.clips.sequences.depth_outliers:FARTHER", "{:.1f}"),
    "view.outside": Setting("endotsr.clips.sequences.field_of_view:LEAST_OUTSIDE", scale=100),
    "view.inside": Setting("endotsr.clips.sequences.field_of_view:LEAST_INSIDE", scale=100),
    "mask.tissue": Setting("endotsr.clips.sequences.masks:LEAST_TISSUE_FRACTION", scale=100),
    "mask.soft": Setting("endotsr.clips.sequences.mask_values:MOST_SOFT_FRACTION", scale=100),
    "mask.missing": Setting("endotsr.clips.sequences.mask_polarity:LEAST_MISSING_FRACTION", scale=100),
    "mask.opposite": Setting("endotsr.clips.sequences.mask_polarity:OPPOSITE_FRACTION", scale=100),
    "masks.kept": Setting("endotsr.clips.flow.clip_flows:MOST_BYTES", scale=1e-9),
    "camera.spread": Setting("endotsr.clips.formats.camera:SPREAD", "{:.1f}", 100),
    "depth.farthest": Setting("endotsr.cli.depth:DepthOptions.farthest_over_nearest"),
    "origin.far": Setting("endotsr.clips.sequences.world:FAR_FROM_ORIGIN"),
    "windows.patience": Setting("endotsr.untrusted.files:PATIENCE"),
    "search.limit": Setting("endotsr.cli.golden:_Reported.search"),
    "page.seconds": Setting("endotsr.results.views.page:SECONDS"),
    "mesh.voxel": Setting("endotsr.results.export.mesh:PIXELS_A_VOXEL", "{:.1f}"),
    "sharp.bridged": Setting("endotsr.config:SHARP.training.bridge_fraction", scale=100),
    "rate.motion": Setting("endotsr.config:PAPER.optimiser.spectral_motion_factor", scale=100),
    "scale.memory": Setting("pages.bench.scale:MEMORY"),
    "speed.pixels": Setting("endotsr.training.runs.speed:LEAST_PIXELS", "{:.0f}"),
    "duration.assumed": Setting("endotsr.clips.sequences.forecast.seconds:SECONDS", "{:.3f}"),
    "claims.hundredth": Setting("pages.claims.rules:HUNDREDTH", "{:.2f}"),
    "claims.power": Setting("pages.claims.power:POWER", scale=100),
    "sfm.registered": Setting("endotsr.clips.poses.structure:REGISTERED", scale=100),
    "sfm.spread": Setting("endotsr.clips.poses.path_scale:LARGEST_SPREAD", scale=100),
    "sfm.frames": Setting("endotsr.clips.poses.path_scale:MOST_FRAMES"),
    "sfm.inside": Setting("endotsr.clips.poses.path_scale:LARGEST_INSIDE", scale=100),
    "registration.mad": Setting("endotsr.clips.poses.pair_kernels:MAD", "{:.4f}"),
    "registration.floor": Setting("endotsr.clips.poses.bundle:FLOOR", "{:.2f}"),
    "registration.window": Setting("endotsr.clips.poses.levels:LOCAL"),
    "tracks.depth": Setting("endotsr.clips.flow.tracks:DEPTH_JUMP", scale=2 * 100),
    "tracks.again": Setting("endotsr.clips.flow.tracks:DEPTH_JUMP", "{:.1f}", 100 / 4),
    "between.nearest": Setting("endotsr.clips.flow.tissue_colours:NEAREST"),
    "between.window": Setting("endotsr.clips.flow.between:NEARBY"),
    "window.warm": Setting("endotsr.studies.windows.make:WARM", scale=100),
    "window.carried": Setting("endotsr.studies.windows.carry:CARRIED", scale=100),
    "window.margin": Setting("endotsr.studies.windows.carry:MARGIN", scale=100),
    "window.path": Setting("endotsr.studies.windows.plan:PATH", scale=100),
    "window.tissue": Setting("endotsr.studies.windows.plan:LEAST_TISSUE", scale=100),
    "window.step": Setting("endotsr.studies.windows.survey:LARGEST_STEP", scale=100),
    "effects.width": Setting("endotsr.clips.effects.frames:WIDEST"),
    "effects.drift": Setting("endotsr.clips.poses.movement:DRIFT", scale=100),
    "effects.motion": Setting("endotsr.clips.effects.motion:LEAST_MOTION", "{:.2f}"),
    "effects.explained": Setting("endotsr.clips.effects.motion:EXPLAINED", scale=100),
    "effects.rates": Setting("endotsr.clips.effects.periodic:ALARM", scale=100),
    "effects.line": Setting("endotsr.clips.effects.periodic:EXPLAINED", scale=100),
    "effects.light": Setting("endotsr.clips.effects.photometric:ALARM", scale=100),
    "effects.highlight": Setting("endotsr.clips.effects.seen:LEAST_HIGHLIGHT", "{:.1f}", 100),
    "effects.holes": Setting("endotsr.clips.effects.seen:HOLES", scale=100),
    "effects.relative": Setting("endotsr.clips.effects.seen:RELATIVE", "{:.1f}", 100),
    "effects.region": Setting("endotsr.clips.effects.topology:LEAST_REGION", "{:.1f}", 100),
}
