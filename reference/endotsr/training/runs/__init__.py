"""Run folders: files and records of a run, and how it is trained, resumed and opened.

folder    the folder and its records          log       log.jsonl, truncated at the checkpoint on resume
files     atomic writes, checked paths        machine   versions, processor, memory, time
sources   sequences by name: a folder, or `simulated`; the only module that imports both readers and simulator
model     checkpoint -> model or training     training  training with logs and checkpoints
records   types of run.json                   diverged  the state before an iteration that was not finite
pace      settings for a training time        stopping  signals, deferred until an iteration ends
time_left time left of a training             speed     the speed of this machine, kept between trainings
"""
