"""The method, compiled: forward passes, and below each its manual reverse pass.

In: NumPy arrays, Gaussian index last. Out: values, and saved tuples for the reverse pass. Each equation has a twin in
`endotsr.definition`, against which it is tested. This storey does not know clips, files or the trainer; equations (6)
and (B10) to (B12) are in `endotsr.training`.

kernels    compilation, threads, the exponential         equations  (1) to (5) and (7) of the paper, (B1), (B13), (B16)
losses     the losses on images, from (B6) on            splatting  the rasteriser, (B2) to (B5), and (B19)
"""
