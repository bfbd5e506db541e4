"""Run folders: the files and records of a run, and how it is trained, resumed and read again.

folder    the folder and its records          log       log.jsonl, cut at the checkpoint when a run is resumed
files     files replaced whole, or refused    machine   versions, processor, memory, time
sources   sequences by name: a folder, or `simulated`; the only module that imports both readers and simulator
model     checkpoint -> model or training     training  a training that fills the folder
records   what run.json may say                      diverged  the state before an iteration that was not finite
stopping  signals, deferred while an iteration finishes
"""
