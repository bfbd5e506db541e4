"""The fast path of compositing: it computes the sums of `splatting.compositing` for many pixels at a time."""
