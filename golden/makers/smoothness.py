"""Family `smoothness`: the smoothness loss (B9), with the edges of the image given.

A rendered depth and image, a tissue mask and a mask of edges come in, so that no port needs an edge detector. The cases
separate the squared steps inside tissue from the total variation outside.
"""

import numpy as np

from makers.images import HEIGHT, WIDTH, nothing, tool_mask
from makers.making import Seeds, Spec, given, scalar
from makers.wrong import edit, port

OPERATIONS = ("smoothness",)


def cases() -> list[Spec]:
    """Some, only and no tissue."""
    edges = np.zeros((HEIGHT, WIDTH), bool)
    edges[1:8, 4] = True
    rows = [
        ("generic", tool_mask(), "Squared steps of smooth tissue, total variation outside",
         ("edges_ignored", "variation_of_tissue", "smoothness_on_all_pixels",
          "squared_steps_over_all_pixels", "squared_steps_without_two")),
        ("all_tissue", given(np.ones((HEIGHT, WIDTH), bool), "all True"), "All tissue: no total variation",
         ("variation_of_tissue", "edges_ignored")),
        ("no_tissue", nothing(), "No tissue: total variation alone", ("variation_of_tissue",)),
    ]  # fmt: skip
    out = []
    for case, mask, title, flags in rows:
        seeds = Seeds("smoothness", case)
        inputs = {
            "rendered_depth": seeds.uniform("rendered_depth", 1.0, 3.0, HEIGHT, WIDTH, unit="scene unit"),
            "rendered": seeds.uniform("rendered", 0.1, 0.9, 3, HEIGHT, WIDTH, unit="display"),
            "mask": mask,
            "edges": given(edges, "True in column 4, rows 1..7"),
            "d_loss": scalar(0.5),
        }
        out.append(Spec("smoothness", case, "smoothness", title, flags, {"total_variation_factor": 3.0}, inputs))
    return out


# ---- mistakes ----

SOURCE = "losses.smoothness"
SMOOTH = 'smooth = mask & ~check_plane("edges", edges, mask.shape)'

WRONG_PORTS = [
    port(
        "edges_ignored",
        "Smoothing across edges",
        "all neighbours; right: not across an edge",
        "smoothness",
        edit(SOURCE, SMOOTH, "smooth = mask.copy()"),
    ),
    port(
        "variation_of_tissue",
        "Total variation of the tissue",
        "inside; right: of the excluded region",
        "smoothness",
        edit(SOURCE, "mask = np.ascontiguousarray(mask)", "mask = np.ascontiguousarray(~mask)"),
    ),
    port(
        "smoothness_on_all_pixels",
        "Squared steps on all pixels",
        "mask ignored; right: tissue only",
        "smoothness",
        edit(SOURCE, SMOOTH, 'smooth = ~check_plane("edges", edges, mask.shape)'),
    ),
    port(
        "squared_steps_over_all_pixels",
        "Squared steps averaged over all pixels",
        "over H W; right: smooth pixels",
        "smoothness",
        edit(SOURCE, "(np.count_nonzero(smooth) + FEW_PIXELS)", "smooth.size"),
    ),
    port(
        "squared_steps_without_two",
        "Gradient of a squared step without its 2",
        "step; right: 2 step",
        "smoothness",
        edit(SOURCE, "type(2 * float(d_loss)", "type(float(d_loss)"),
    ),
]
