"""The method, compiled: forward passes, and below each its manual reverse pass.

In: NumPy arrays, Gaussian index last. Out: values, and saved tuples for the reverse pass. Each public function has a
twin in `endotsr.definition`, against which it is tested. This storey does not know clips, files or the trainer.

kernels    compilation, threads, the exponential         equations  equations (1) to (7) of the paper, and their parts
losses     the base losses on images                     splatting  the rasteriser
"""
