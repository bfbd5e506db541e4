"""Fused sweeps of training: reverse pass, Adam step and next forward pass in one pass over each array."""
