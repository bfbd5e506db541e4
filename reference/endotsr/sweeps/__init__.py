"""Sweeps: lists of independent runs, on the cores of this machine or on a cluster, and what their results say.

spec       a SPEC.toml, checked                 jobs      the runs of a spec, and what their folders say
execute    one run: trained, continued, measured       place     this machine, its memory and cores, or a cluster
local      the runs on a pool of processes      cluster   the same runs on an existing Dask cluster
sweep      all of it, resumable run by run
results    the table of the runs as JSON, CSV and Markdown
ablation   the configurations of the paper's claims, and paired differences with intervals

A run folder is the only record of a run: what is finished is read from there, so that a killed sweep loses nothing.
"""
