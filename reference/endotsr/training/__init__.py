"""Training: the Gaussians, one iteration, the schedules, and the folder of a run.

In: a `Sequence` and a `Config`. Out: a trained model, checkpoints and logs. This storey does not know how a result is
measured, drawn or exported.

scene      the Gaussians, initialisation, density        fitting    Adam, schedules, the loop, checkpoints
runs       run folders: resume, stop, records
"""
