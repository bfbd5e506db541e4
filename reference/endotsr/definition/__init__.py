"""The method as text: every equation of the paper and of the base model in plain NumPy, forward and reverse.

In: arrays with the Gaussian index last, float64, and settings by name. Out: what the specification says, as it says it.
The room may know NumPy and itself, nothing else. The functions have the names, the argument order, the shapes and the
fields of the compiled ones in `equations`, `splatting`, `losses`, `scene` and `fitting`, whose docstrings hold the
contracts; those are tested against these. Decisions look at real parts, so most functions take complex numbers too.

    dictionary (1)  appearance (2)  motion (3)  matern (4)  laplacian (5)  objective (6)  calibration (7)
    deformation (B1)  covariance (B2)  projection (B3)  harmonics (B4)  compositing (B5)  render (B2)-(B5)
    masked_l1 (B6)  masked_ssim (B7)  depth (B8)  smoothness (B9)  adam, schedules (B10)  density_control (B11)
    initialisation (B12)  exposure (B13)  pose (B16)  metrics (M1), (M2)

What begins with an optical flow, (B14) and (B15), and LPIPS (M3) are not formulas of NumPy and are not here.

`view` is one iteration, `train` a whole training, and `python -m endotsr.definition` trains a small scene.
"""
