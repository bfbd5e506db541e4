"""Family `smoothness`: the smoothness loss (B9), with the edges of the image given.

Inputs: a rendered depth and image, a tissue mask and a mask of edges; no port needs an edge detector. The cases
distinguish the squared steps inside tissue from the total variation outside.
"""

import numpy as np

from makers.images import HEIGHT, WIDTH, nothing, tool_mask
from makers.making import Seeds, Spec, given, scalar
from makers.operations import PER_DISPLAY, PER_LENGTH, Declared, Judged

DECLARED = {
    "smoothness": Declared(
        {
            "loss": Judged(1, "scene unit^2", oracle="smoothness.smoothness_forward"),
            "d_rendered": Judged(2, PER_DISPLAY, oracle="smoothness.smoothness_forward"),
            "d_rendered_depth": Judged(2, PER_LENGTH, oracle="smoothness.smoothness_forward"),
        },
        "`edges` are given; in `training` there are none",
        settings={"total_variation_factor": "loss.total_variation_factor"},
    )
}
OPERATIONS = tuple(DECLARED)


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
