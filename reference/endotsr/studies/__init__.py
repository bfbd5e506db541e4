"""Studies: many runs or measurements as one piece of work.

In: a specification of runs, or a fixed workload. Out: records with intervals. A study calls training and results, and
changes neither.

bench      time by stage, with its limit                 tradeoff   accuracy against time
sweeps     independent runs, here or on a cluster        windows    long recordings as overlapping windows
"""
