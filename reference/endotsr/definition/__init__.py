"""The method as text: every equation of the paper and of the base model in plain NumPy, forward and reverse.

In: float64 arrays with the Gaussian index last, and settings by name. Out: values and gradients, by the formulas of the
specification. The room imports only NumPy and itself. Its functions share names, argument order, shapes and fields with
the compiled functions of `equations`, `splatting`, `losses`, `scene` and `fitting`. Those have the full contracts in
their docstrings and are tested against these. Most functions accept complex input: branches compare real parts.

    dictionary (1)  appearance (2)  motion (3)  matern (4)  laplacian (5)  objective (6)  calibration (7)
    deformation (B1)  covariance (B2)  projection (B3)  harmonics (B4)  compositing (B5)  render (B2)-(B5)
    masked_l1 (B6)  masked_ssim (B7)  depth (B8)  smoothness (B9)  adam, schedules (B10)  density_control (B11)
    initialisation (B12)  exposure (B13)  pose (B16)  metrics (M1), (M2)

(B14) and (B15) start from an optical flow, and LPIPS (M3) needs a trained network; they are not in this room.

`view` is one iteration and `train` a whole training. `python -m endotsr.definition` trains a small scene.
"""
