"""Sweeps: independent runs on this machine or on a cluster, and their results.

spec       SPEC.toml, checked                        jobs      the runs of a spec and the state of their folders
execute    train, continue and evaluate one run      place     this machine with its memory and cores, or a cluster
local      runs on a pool of processes               cluster   runs on an existing Dask cluster
sweep      the whole sweep, resumable run by run     results   the table of runs as JSON, CSV and Markdown
ablation   configurations for the paper's claims, and paired differences with intervals

A run folder is the only record of its run; a killed sweep loses no finished run.
"""
