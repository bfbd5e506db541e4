"""The method as text: every equation of the paper and of the base model in plain NumPy, forward and reverse.

In: float64 arrays with the Gaussian index last, and settings by name. Out: values and gradients, by the formulas of the
specification. This storey imports only NumPy and itself. A function with a compiled twin has its name and is tested
against it; the docstring of the twin has the full contract. The twin takes the same arguments in the same order, and
may take more: types, timers, gradients that can be left out. Six take others: `composite_forward` (the compiled one
takes packed records and tile lists), `rotation_of` and `rotation_reverse` (four numbers in place of an array),
`exponential` (of a matrix here), `calibrated_weight` and `train` (they continue a state). A tuple that exists in both
has the same fields, but for `Calibration`, `ViewGradients` and saved tuples, which keep what their own reverse pass
reads. Apart from `calibrate`, no function here raises an error of its own: the checks that a contract lists under
*Raises* are those of the twin. Most functions accept complex input: branches compare real parts.

    dictionary (1)  appearance (2)  motion (3)  matern (4)  laplacian (5)  objective (6)  calibration (7)
    deformation (B1)  covariance (B2)  projection (B3)  harmonics (B4)  compositing (B5)  render (B2)-(B5)
    masked_l1 (B6)  masked_ssim (B7)  depth (B8)  smoothness (B9)  adam, schedules (B10)  density_control (B11)
    initialisation (B12)

Options and metrics have modules of their own. The first line of a module names its equations.
`legacy` has the four deviations of the CUDA rasterisers; the other files are the equations alone.
(B14) and (B15) start from an optical flow, (B17) and (B18) plan runs, and LPIPS (M3) needs a trained network; they are
not in this room.

`view` is the forward and reverse pass of one iteration, and `train` is a whole training. `python -m endotsr.definition`
trains a small scene.
"""
