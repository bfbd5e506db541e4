"""endotsr: the reference implementation of Endo-TSR on the CPU.

Data walks through the package in the order of the paper. `equations` holds the paper, one equation a
module; `splatting` the rasteriser; `losses` the base losses; `scene` what is fitted; `fitting` the
training; `sequences` and `simulator` what is read; `evaluation` what is measured. Every forward pass
`<stage>_forward` has its manual reverse pass `<stage>_reverse` directly below it.

Importing this package imports nothing heavy; import the room you need.
"""

__version__ = "0.1.0"
