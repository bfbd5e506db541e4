"""Mistakes that were invented from docs/specification, before their author read the list of known mistakes.

Each has the stage where it is made, a sentence, the replaced choices of `port.py`, and its facts: statements about the
outputs that are true of it, any of which a report may make in place of a name. Do not change this file so that a report
looks better; a new set belongs into a new file.
"""

from typing import NamedTuple

import numpy as np


class Mistake(NamedTuple):
    """A wrong port: `wrong` replaces choices, `facts` are true statements about what its outputs then show."""

    place: str
    text: str
    wrong: dict
    facts: tuple = ()


def on(name, change):
    """An output of the stage itself is changed afterwards; other stages keep theirs."""

    def changed(operation, out, inputs, settings):
        return out | {name: change(out[name], inputs, settings)} if name in out else out

    return {"afterwards": (changed,)}


def times(name, factor):
    return on(name, lambda a, i, s: a * factor)


def entry(name, at, change):
    """One index of the first axis is changed."""

    def changed(a, i, s):
        a = np.array(a)
        a[at] = change(a[at])
        return a

    return on(name, changed)


def reordered(name, order):
    return on(name, lambda a, i, s: a[list(order)])


def turned(a, i, s):
    """W g where W^T g is right."""
    w = i["rotation_matrix"]
    return w @ w @ a


R = {"reverse only": True}
F = {"forward only": True}

MISTAKES = (
    # time
    Mistake("frequencies", "evenly spaced frequencies", {"linear frequencies": True}),
    Mistake("frequencies", "the ratio to the power f / F", {"frequency steps": lambda n: n}),
    Mistake("frequencies", "one frequency is the highest", {"one frequency is the highest": True}, (("case", "one"),)),
    Mistake("dictionary", "sine and cosine in turn", {"interleaved": True}, (("order", "phi"),)),
    Mistake("dictionary", "cosines first", {"cosines first": True}, (("order", "phi"),)),
    Mistake("dictionary", "2 pi forgotten", {"turn": 1.0}),
    Mistake("dictionary", "pi in place of 2 pi", {"turn": np.pi}),
    Mistake("dictionary", "cosine with a minus", {"cosine sign": -1}, (("sign", "phi"), ("half", "phi"))),
    Mistake(
        "dictionary",
        "2 pi forgotten in d_omega",
        times("d_omega", 1 / (2 * np.pi)),
        (("times", "d_omega", 1 / (2 * np.pi)),),
    ),
    Mistake(
        "dictionary", "d_t has the sign of the cosine's derivative wrong", times("d_t", -1.0), (("times", "d_t", -1.0),)
    ),
    Mistake("atoms", "atoms divided by their variance's n - 1", {"degrees of freedom": 1}),
    Mistake("atoms", "RMS of the raw atom", {"centred": 0}),
    Mistake(
        "atoms", "the mean is not subtracted", {"atoms not centred": True}, (("plus", "phi_bar"), ("only", "phi_bar"))
    ),
    Mistake("atoms", "held-out stamps counted", {"all stamps": True}),
    Mistake("atoms", "repeated stamps counted again", {"stamps counted twice": True}, (("case", "repeated_stamps"),)),
    Mistake("atoms", "dead below 1e-18", {"dead below": 1e-18}, (("case", "dead_atom"),)),
    Mistake(
        "atoms",
        "the reverse pass forgets the RMS",
        on("d_phi", lambda a, i, s: np.where(a == 0, 0, i["d_phi_bar"])),
        (("only", "d_phi"),),
    ),
    Mistake(
        "appearance", "Y00 is 0.2821 to four digits", {"y00": 0.2821}, (("times", "*", 0.28209479177387814 / 0.2821),)
    ),
    Mistake("appearance", "beta not divided by Y00", {"y00": 1.0}, (("times", "*", 0.28209479177387814),)),
    Mistake("appearance", "arctan in place of tanh", {"squash": np.arctan}),
    Mistake("appearance", "tanh of half the argument", {"steepness": 0.5}),
    Mistake("appearance", "no tanh, only beta", {"squash": lambda x: x}),
    Mistake(
        "appearance",
        "the derivative of tanh is forgotten",
        {"squash": lambda x: np.tanh(x.real) + 1j * x.imag} | R,
        (("reverse", "appearance"),),
    ),
    Mistake(
        "motion",
        "the gradient by phi is summed over x alone",
        on("d_phi", lambda a, i, s: np.einsum("kn,n->k", i["motion_coefficients"][0], i["d_translation"][0])),
        (("only", "d_phi"),),
    ),
    Mistake(
        "motion",
        "the gradient by C has the wrong sign",
        times("d_motion_coefficients", -1.0),
        (("times", "d_motion_coefficients", -1.0),),
    ),
    Mistake("matern", "power 5/2", {"matern power": 2.5}),
    Mistake("matern", "Matern-3/2: 3 and power 2", {"matern order": 3, "matern power": 2}),
    Mistake("matern", "3 in place of 5", {"matern order": 3}),
    Mistake("matern", "omega without 2 pi", {"matern turn": 1.0}),
    Mistake("matern", "weights of sum 1", {"rho norm": np.sum}, (("times", "*", 1 / 4), ("times", "*", 1 / 8))),
    Mistake("matern", "largest weight 1", {"rho norm": np.max}, (("ratio", "rho"),)),
    Mistake("matern", "the penalty is a sum", {"penalty mean": False}, (("ratio", "penalty"),)),
    Mistake("matern", "half the penalty, as of a squared norm", {"penalty times": 0.5}, (("times", "penalty", 0.5),)),
    Mistake("matern", "weights in pairs of sine and cosine", {"rho interleaved": True}),
    Mistake(
        "matern",
        "cosines without penalty",
        {"sines only": True},
        (("half", "d_motion_coefficients"), ("zero", "d_motion_coefficients")),
    ),
    Mistake(
        "matern",
        "the gradient without the 2 of the square",
        times("d_motion_coefficients", 0.5),
        (("times", "d_motion_coefficients", 0.5),),
    ),
    Mistake("deformation", "floor of the width 1e-6", {"width floor": 1e-6}),
    Mistake("deformation", "no floor of the width", {"width floor": 0.0}),
    Mistake("deformation", "the width is not squared", {"width not squared": True}),
    Mistake("deformation", "exp(-u) in place of exp(-u^2)", {"quartic power": 1}, (("case", "quartic"),)),
    Mistake("deformation", "the 2 of the gaussian is missing", {"gaussian two": 1}, (("case", "gaussian"),)),
    Mistake("deformation", "d_t has the sign of the centre's", times("d_t", -1.0), (("times", "d_t", -1.0),)),
    Mistake(
        "deformation",
        "d_fdm_width forgets the 2 of the square",
        times("d_fdm_width", 0.5),
        (("times", "d_fdm_width", 0.5),),
    ),
    Mistake("exposure", "gain 1 + g in place of exp(g)", {"gain linear": True}),
    Mistake("exposure", "the bias is multiplied by the gain", {"bias first": True}),
    Mistake("exposure", "the exposed colour is clamped at 1", {"exposed clamp": True}, (("clamp", "exposed", 1.0),)),
    Mistake(
        "exposure",
        "d_log_gain forgets the gain",
        on("d_log_gain", lambda a, i, s: a / np.exp(i["log_gain"])),
        (("only", "d_log_gain"),),
    ),
    Mistake("pose", "first order in the rotation vector", {"pose terms": 2}),
    Mistake("pose", "second order in the rotation vector", {"pose terms": 3}),
    Mistake("pose", "the inverse rotation", {"pose inverse": True}),
    Mistake("pose", "the correction from the right", {"pose right": True}),
    Mistake("pose", "the offset is rotated too", {"offset first": True}, (("only", "corrected_translation"),)),
    Mistake("pose", "the translation is not rotated", {"translation kept": True}, (("only", "corrected_translation"),)),
    # losses
    Mistake("masked_l1", "divided by n, not 3 n", {"l1 channels": 1}, (("times", "*", 3.0),)),
    Mistake("masked_l1", "mean over all pixels", {"l1 over all": True}, (("ratio", "loss"),)),
    Mistake("masked_l1", "L2", {"squared": True}),
    Mistake(
        "masked_l1",
        "multiplication by the mask",
        {"multiply mask": True},
        (("case", "not_finite_under_mask"), ("nan", "loss")),
    ),
    Mistake("masked_l1", "1 for an empty mask", {"l1 empty": 1.0}, (("case", "no_tissue"),)),
    Mistake("masked_ssim", "sigma 2", {"sigma": 2.0}),
    Mistake("masked_ssim", "sigma 1", {"sigma": 1.0}),
    Mistake("masked_ssim", "window of 7", {"window half": 3}),
    Mistake("masked_ssim", "window of 13", {"window half": 6}),
    Mistake("masked_ssim", "box window", {"sigma": 1e6}),
    Mistake("masked_ssim", "exp(-x^2 / sigma^2)", {"window two": 1}),
    Mistake("masked_ssim", "border by reflection", {"window border": "reflect"}),
    Mistake("masked_ssim", "border by repetition", {"window border": "edge"}),
    Mistake("masked_ssim", "window renormalised at the border", {"window renormalised": True}),
    Mistake("masked_ssim", "C1 and C2 exchanged", {"ssim c1": 9e-4, "ssim c2": 1e-4}),
    Mistake("masked_ssim", "K2 = 0.02", {"ssim c2": 4e-4}),
    Mistake("masked_ssim", "constants of images up to 255", {"ssim range": 255}),
    Mistake("masked_ssim", "no constants", {"ssim c1": 1e-12, "ssim c2": 1e-12}),
    Mistake("masked_ssim", "variances of a sample", {"sample variance": True}),
    Mistake("masked_ssim", "contrast and structure alone", {"contrast only": True}),
    Mistake("masked_ssim", "mean over all pixels", {"ssim over all": True}),
    Mistake("masked_ssim", "0 for an empty mask", {"ssim empty": 0.0}, (("case", "no_tissue"),)),
    Mistake(
        "masked_ssim",
        "the gradient reaches excluded pixels",
        on("d_rendered", lambda a, i, s: np.where(i["mask"], a, 1e-3)),
        (("where", "masked"),),
    ),
    Mistake(
        "masked_ssim", "the gradient is that of 1 - SSIM", times("d_rendered", -1.0), (("times", "d_rendered", -1.0),)
    ),
    Mistake("normalised_depth", "the rendered maximum on tissue alone", {"depth maximum on tissue": True}),
    Mistake("normalised_depth", "the prior maximum on tissue alone", {"prior maximum on tissue": True}),
    Mistake(
        "normalised_depth",
        "the maximum is a constant of the derivative",
        {"maximum constant": True},
        (("only", "d_rendered_depth"),),
    ),
    Mistake("normalised_depth", "divided by the tissue pixels", {"depth over tissue": True}, (("ratio", "loss"),)),
    Mistake(
        "normalised_depth",
        "the first of two maxima has the gradient",
        {"first of ties": True},
        (("case", "two_maxima"),),
    ),
    Mistake(
        "normalised_depth", "every maximum has the whole gradient", {"ties summed": True}, (("case", "two_maxima"),)
    ),
    Mistake("normalised_depth", "at least eleven priors", {"least priors": 11}, (("case", "ten_priors"),)),
    Mistake("normalised_depth", "squared differences", {"depth squared": True}),
    Mistake("smoothness", "edges are ignored", {"edges ignored": True}),
    Mistake("smoothness", "steps along columns alone", {"step axes": (0,)}),
    Mistake("smoothness", "steps along rows alone", {"step axes": (1,)}),
    Mistake("smoothness", "absolute steps", {"absolute steps": True}),
    Mistake("smoothness", "steps over all pixels", {"steps over all": True}),
    Mistake("smoothness", "factor 30 built in", {"variation factor": 30.0}),
    Mistake("smoothness", "no variation of depth", {"depth variation": False}, (("only", "d_rendered_depth"),)),
    Mistake("smoothness", "no variation of colour", {"colour variation": False}, (("zero", "d_rendered"),)),
    Mistake("smoothness", "variation of the tissue", {"variation of tissue": True}),
    Mistake("smoothness", "no step at the border of the mask", {"no step at the border": True}),
    Mistake("smoothness", "variation divided by the excluded pixels", {"variation over outside": True}),
    Mistake("laplacian", "filter 1 3 4 3 1", {"pyramid filter": (1, 3, 4, 3, 1)}),
    Mistake("laplacian", "filter 1 2 1", {"pyramid filter": (0, 1, 2, 1, 0)}),
    Mistake("laplacian", "odd samples kept", {"odd samples": 1}),
    Mistake("laplacian", "border by repetition", {"reflection": "edge"}, (("where", "border"),)),
    Mistake("laplacian", "nearest up-sampling", {"upsampling": "nearest"}),
    Mistake("laplacian", "always half-pixel", {"upsampling": "half_pixel"}),
    Mistake("laplacian", "coarse level valid by its centre", {"support of the centre": True}),
    Mistake("laplacian", "the support of the up-sampling is forgotten", {"up-sampled support forgotten": True}),
    Mistake("laplacian", "coarse bands count double", {"band weights": (1, 2, 4)}),
    Mistake("laplacian", "a sum of the levels", {"levels in the mean": 1}, (("times", "*", 3.0),)),
    Mistake("laplacian", "bands divided by all values", {"bands over all": True}),
    Mistake("laplacian", "d_rendered misses the factor 1/3", times("d_rendered", 3.0), (("times", "d_rendered", 3.0),)),
    # a Gaussian
    Mistake("covariance", "quaternions x, y, z, w", {"w last": True}),
    Mistake("covariance", "R transposed", {"rotation transposed": True}, (("transposed", "rotation"),)),
    Mistake("covariance", "quaternions not normalised", {"not normalised": True}),
    Mistake("covariance", "exp of half the log-scale", {"log-scale times": 0.5}),
    Mistake("covariance", "log-scales clipped at 20", {"log-scale limit": 20}, (("case", "clipped_log_scale"),)),
    Mistake(
        "covariance",
        "d_log_scale without the scale",
        on("d_log_scale", lambda a, i, s: np.where(a == 0, 0, i["d_scale"])),
        (("only", "d_log_scale"),),
    ),
    Mistake(
        "covariance",
        "d_quaternion is not divided by the length",
        on("d_quaternion", lambda a, i, s: a * np.linalg.norm(i["quaternion"], axis=0)),
        (("only", "d_quaternion"),),
    ),
    Mistake(
        "covariance",
        "d_quaternion stays along the quaternion",
        on("d_quaternion", lambda a, i, s: a + 0.3 * i["quaternion"]),
        (("only", "d_quaternion"),),
    ),
    Mistake("projection", "fx for both axes", {"one focal length": True}, (("axis", "mean2d", 1),)),
    Mistake(
        "projection",
        "the middle of the image is the principal point",
        {"centre of the image": True},
        (("plus", "mean2d"), ("axis", "mean2d", 1)),
    ),
    Mistake("projection", "integer pixel coordinates", {"pixel offset": -0.5}, (("plus", "mean2d"),)),
    Mistake("projection", "the pose is camera to world", {"camera to world": True}),
    Mistake("projection", "clamp at 1.15", {"clamp": 1.15}),
    Mistake("projection", "clamp at 1.0", {"clamp": 1.0}),
    Mistake("projection", "near 0.01", {"near": 0.01}, (("only", "visible"), ("entries", "visible"))),
    Mistake("projection", "low-pass 0.1", {"low-pass": 0.1}, (("plus", "covariance2d"),)),
    Mistake(
        "projection",
        "low-pass of a alone",
        {"low-pass of c": 0.0},
        (("axis", "covariance2d", 2), ("plus", "covariance2d")),
    ),
    Mistake(
        "projection",
        "distance in place of depth",
        {"depth is distance": True},
        (("only", "depth"), ("forward", "depth")),
    ),
    Mistake("projection", "J without its third column", {"J without depth": True}),
    Mistake("projection", "W transposed in the covariance", {"W transposed in T": True}),
    Mistake(
        "projection",
        "no gradient through J",
        {"J constant": True} | R,
        (("only", "d_position"), ("reverse", "projection")),
    ),
    Mistake("projection", "z in J has no gradient", {"depth in J constant": True} | R, (("reverse", "projection"),)),
    Mistake(
        "projection",
        "d_position by W in place of its transpose",
        on("d_position", turned),
        (("only", "d_position"), ("matrix", "d_position")),
    ),
    Mistake("projection", "d_scale without the 2", times("d_scale", 0.5), (("times", "d_scale", 0.5),)),
    Mistake(
        "projection",
        "d_rotation transposed",
        on("d_rotation", lambda a, i, s: a.swapaxes(0, 1)),
        (("transposed", "d_rotation"),),
    ),
    Mistake(
        "projection",
        "d_rotation_matrix transposed",
        on("d_rotation_matrix", lambda a, i, s: a.T),
        (("transposed", "d_rotation_matrix"),),
    ),
    Mistake(
        "projection",
        "d_translation by W^T",
        on("d_translation", lambda a, i, s: i["rotation_matrix"].T @ a),
        (("only", "d_translation"), ("matrix", "d_translation")),
    ),
    Mistake("projection", "a and c exchanged", reordered("covariance2d", (2, 1, 0)), (("order", "covariance2d"),)),
    Mistake("harmonics", "Y1 has the sign +y", {"basis times": {1: -1}}),
    Mistake("harmonics", "all of degree 1 without signs", {"basis times": {1: -1, 3: -1}}),
    Mistake("harmonics", "order x, y, z in degree 1", {"basis order": (0, 3, 1, 2, *range(4, 16))}),
    Mistake("harmonics", "constant of Y6 doubled", {"basis times": {6: 2}}),
    Mistake("harmonics", "constant of Y12 with 5 in place of 7", {"basis times": {12: (5 / 7) ** 0.5}}),
    Mistake("harmonics", "Y15 with the opposite sign", {"basis times": {15: -1}}),
    Mistake("harmonics", "direction from the Gaussian to the camera", {"direction reversed": True}),
    Mistake("harmonics", "direction not normalised", {"direction not unit": True}),
    Mistake(
        "harmonics",
        "no gradient by the direction",
        {"direction constant": True} | R,
        (("only", "d_position"), ("only", "d_centre"), ("zero", "d_position")),
    ),
    Mistake("harmonics", "without + 1/2", {"plus half": 0.0}, (("plus", "colour"),)),
    Mistake("harmonics", "clamped at 1", {"colour clamp": True}, (("clamp", "colour", 1.0),)),
    Mistake("harmonics", "no clamp at 0", {"colour floor": -np.inf}, (("clamp", "colour", 0.0),)),
    Mistake("harmonics", "blue first", {"blue first": True}, (("order", "colour"),)),
    Mistake("harmonics", "the residual counts as a colour", {"residual times": 1 / 0.28209479177387814}),
    Mistake(
        "harmonics", "d_centre with the sign of d_position", times("d_centre", -1.0), (("times", "d_centre", -1.0),)
    ),
    Mistake("composite", "pixel corners sampled", {"sample": 0.0}),
    Mistake("composite", "the 2 of the exponent is missing", {"exponent two": 1}),
    Mistake("composite", "index order", {"index order": True}),
    Mistake("composite", "back to front", {"back to front": True}),
    Mistake("composite", "cutoff 1/512", {"cutoff": 1 / 512}),
    Mistake("composite", "stop at 1e-3", {"stop": 1e-3}),
    Mistake("composite", "the Gaussian that stops is drawn", {"stop draws": True}),
    Mistake("composite", "alpha up to 0.999", {"alpha max": 0.999}),
    Mistake("composite", "opacity is 1 - T", {"opacity from transmittance": True}),
    Mistake("composite", "depth divided by opacity", {"depth normalised": True}, (("only", "depth_image"),)),
    Mistake("composite", "no background", {"with background": False}),
    Mistake("composite", "the background is not weighted", {"background unweighted": True}),
    Mistake("composite", "b has the wrong sign", {"b times": -1}),
    Mistake(
        "composite",
        "no gradient of the depth image by z",
        {"depth gradient dropped": True} | R,
        (("zero", "d_depth"), ("only", "d_depth")),
    ),
    Mistake(
        "composite",
        "d_covariance2d of b halved",
        entry("d_covariance2d", 1, lambda a: a / 2),
        (("axis", "d_covariance2d", 1),),
    ),
    Mistake(
        "composite",
        "d_opacity_logit without 1 - o",
        on("d_opacity_logit", lambda a, i, s: a * (1 + np.exp(i["opacity_logit"]))),
        (("only", "d_opacity_logit"),),
    ),
    Mistake(
        "composite", "d_mean2d with the sign of the pixel", times("d_mean2d", -1.0), (("times", "d_mean2d", -1.0),)
    ),
    Mistake(
        "composite",
        "d_colour forgets transmittance",
        on("d_colour", lambda a, i, s: a * 1.25),
        (("only", "d_colour"), ("times", "d_colour", 1.25)),
    ),
    Mistake("composite", "tiles of 8", {"tile": 8}, (("case", "legacy"), ("case", "tiles"))),
    Mistake("composite", "two sigmas", {"sigmas": 2}),
    Mistake("composite", "tiles by the centre without the half", {"tile half": 0.0}, (("case", "tiles"),)),
    # decisions
    Mistake("calibration", "the mean of the ratios", {"typical": "mean"}),
    Mistake("calibration", "the lower of the middle two", {"typical": "low"}, (("case", "even"),)),
    Mistake("calibration", "the ratio of the medians", {"inverse medians": True}),
    Mistake("calibration", "mean absolute gradients", {"norm": "mean"}),
    Mistake("calibration", "norms of sums", {"norm": "sum"}, (("ratio", "g_rgb"),)),
    Mistake("calibration", "RMS over tissue", {"rms over valid": True}),
    Mistake("calibration", "ratio times the median", {"ratio upside down": True}),
    Mistake("calibration", "r = 0.2", {"ratio": 0.2}, (("times", "lambda_lap", 0.8),)),
    Mistake("adam", "epsilon inside the root", {"epsilon inside": True}),
    Mistake("adam", "no correction of the first moment", {"first corrected": False}),
    Mistake("adam", "no correction of the second moment", {"second corrected": False}),
    Mistake("adam", "beta2 0.99", {"beta2": 0.99}),
    Mistake("adam", "beta1 0.95", {"beta1": 0.95}),
    Mistake("adam", "epsilon 1e-8", {"epsilon": 1e-8}),
    Mistake("adam", "the count starts at 2", {"first step": 2}),
    Mistake("adam", "RMSprop", {"rmsprop": True}),
    Mistake("adam", "weight decay of 0.01", {"weight decay": 0.01}),
    Mistake("schedule", "linear decay", {"linear decay": True}),
    Mistake("schedule", "decay from i - 1", {"decay from": 1}),
    Mistake("schedule", "the residual schedule is never restarted or always", {"restart": True}),
    Mistake("schedule", "the ramp starts one late", {"ramp shift": 1}),
    Mistake("schedule", "the ramp is one longer", {"ramp longer": 1}),
    Mistake("schedule", "degree by i - 1", {"degree shift": -1}, (("only", "degree"),)),
    Mistake("schedule", "densification at the last iteration too", {"until shift": 1}),
    Mistake("schedule", "densification from the start on", {"start shift": -1}, (("only", "densifies"),)),
    Mistake("schedule", "smoothness one late", {"smooth shift": 1}, (("only", "smoothness"),)),
    Mistake("schedule", "residuals one late", {"residual shift": 1}),
    Mistake("schedule", "the position has a constant rate", {"position decays": False}, (("only", "rate_position"),)),
    Mistake(
        "schedule",
        "rates of degree 1 to 3 a tenth of degree 0",
        {"rest": 2.5e-4},
        (("times", "rate_harmonics_rest", 2.0),),
    ),
    Mistake("density", "gradients in px", {"half": 1e9}, (("ratio", "mean_gradient"),)),
    Mistake("density", "W and H in place of halves", {"half": 1}, (("times", "mean_gradient", 2.0),)),
    Mistake("density", "sum of the sides in place of the length", {"sum of sides": True}),
    Mistake("density", "mean over all views", {"views counted": True}),
    Mistake("density", "largest in place of mean", {"largest": True}),
    Mistake("density", "opacity below 0.01 is pruned", {"prune below": 0.01}),
    Mistake("density", "on the prune threshold it goes", {"prune at": True}, (("case", "on_the_thresholds"),)),
    Mistake("density", "the smallest axis decides", {"size": "min"}),
    Mistake("density", "the mean axis decides", {"size": "mean"}),
    Mistake(
        "density", "children shrink by 2", {"shrink": 2.0}, (("only", "log_scale_after"), ("plus", "log_scale_after"))
    ),
    Mistake(
        "density",
        "children shrink by 0.8 * 2",
        {"shrink": 1.28},
        (("only", "log_scale_after"), ("plus", "log_scale_after")),
    ),
    Mistake("density", "noise in the axes of the world", {"not turned": True}, (("only", "position_after"),)),
    Mistake("density", "the children of a parent side by side", {"children interleaved": True}, (("order", "parent"),)),
    Mistake("density", "clones keep the moments", {"clones keep moments": True}, (("only", "moments_kept"),)),
    Mistake("density", "at the maximum the first ones", {"first come": True}, (("case", "maximum"),)),
    Mistake("density", "room for one more", {"room": 1}, (("case", "maximum"),)),
    Mistake(
        "density",
        "extent without 1.1",
        {"extent factor": 1.0},
        (("case", "extent_of_cameras"), ("times", "extent", 1 / 1.1)),
    ),
    Mistake("density", "noise of half the size", {"noise times": 0.5}, (("only", "position_after"),)),
    Mistake("initialisation", "pixel corners lifted", {"pixel": 0.0}, (("only", "position"),)),
    Mistake("initialisation", "lifted with W", {"lifted with W": True}),
    Mistake("initialisation", "two neighbours", {"neighbours": 2}, (("only", "log_scale"),)),
    Mistake("initialisation", "mean of the distances", {"mean of distances": True}, (("only", "log_scale"),)),
    Mistake("initialisation", "opacity 0.2", {"opacity": 0.2}, (("only", "opacity_logit"), ("plus", "opacity_logit"))),
    Mistake(
        "initialisation", "colours from 0", {"colour zero": 0.0}, (("only", "harmonics"), ("axis", "harmonics", 0))
    ),
    Mistake(
        "initialisation", "centres in the middle of intervals", {"centres at ends": False}, (("only", "fdm_centre"),)
    ),
    Mistake(
        "initialisation", "width 0.01 built in", {"width": 0.01}, (("only", "fdm_width"), ("times", "fdm_width", 0.08))
    ),
    Mistake("initialisation", "even frames of a long clip", {"parity": 1}, (("case", "long_clip"),)),
    Mistake("initialisation", "every frame of a long clip", {"long clip": 10**6}, (("case", "long_clip"),)),
    Mistake("initialisation", "threshold 40 built in", {"threshold": 40.0}),
    Mistake("scene", "raw atoms for the colour", {"raw atoms for colour": True}, (("only", "residual_at_t"),)),
    Mistake("scene", "log-scale before quaternion in the channels", {"channels swapped": True}),
)
