"""Input: what training reads, checked, simulated or inspected.

In: files of a recording, or settings of a simulated one. Out: a `Sequence` of arrays, and what is known about it. This
storey does not know Gaussians, runs or results.

opencv     the calls of OpenCV                           sequences  layouts, readers, checks, preparation
simulator  sequences with known truth                    effects    tests for effects in a clip, and a plan
"""
