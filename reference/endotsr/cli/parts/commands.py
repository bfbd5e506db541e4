"""The commands with what they do, and the commands of earlier versions with what does their work."""

COMMANDS = {
    "demo": "train and evaluate a simulated sequence, and write a report: the whole method in two minutes",
    "prepare": "turn a video, pictures or another layout into a folder that `train` reads",
    "depth": "compute depth from stereo pairs, or import it from another program",
    "masks": "propose instrument masks for a clip that has none, with an overlay for inspection",
    "check": "list every fault of a sequence, with its remedy",
    "train": "train on a sequence folder, or continue a run",
    "simulate": "write a simulated sequence with exact ground truth, which `train` reads",
    "inspect": "test a clip for motion, light, instruments and more, and plan the components that it needs",
    "render": "render pictures and films at any time in [0, 1], from any camera",
    "export": "write .ply files, a point cloud, a slim model, or a page that plays the moving scene in any browser",
    "evaluate": "evaluate a run or the pictures of any method with baselines, and compare methods frame by frame",
    "sweep": "make many runs from one file, on this machine or on a cluster, with a table of their results",
    "ablate": "test the paper's claims: components on and off, over seeds, with paired differences",
    "gradcheck": "check every reverse pass against finite differences",
    "bench": "measure the time of each stage of an iteration and its lower limit",
    "tradeoff": "measure error against time and find the best setting within a budget",
    "golden": "golden vectors for ports: judge outputs, run a port, answer as the reference",
}

FORMER = {  # commands of earlier versions, and what does their work
    "calibrate": "endotsr train --out RUN --calibrate-only",
    "compare": "endotsr evaluate METHOD METHOD ...",
    "completion": "endotsr --completion bash|zsh|fish",
    "view": "endotsr export SCENE --out PAGE.html",
}
