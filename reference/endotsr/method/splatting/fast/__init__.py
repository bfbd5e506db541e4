"""The fast path of compositing: the sums of `splatting.compositing`, many pixels at a time."""
