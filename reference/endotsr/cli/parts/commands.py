"""The commands with summaries, and the replacements of commands from earlier versions."""

COMMANDS = {
    "demo": "train and evaluate a simulated sequence, and write a report: the whole method in one command",
    "prepare": "convert a video, pictures or another layout to a folder for `train`",
    "depth": "compute depth from stereo pairs, or import it from another program",
    "masks": "propose instrument masks for a clip without masks, or carry drawn ones from a few frames to all",
    "poses": "estimate the poses of a moving scope, from pictures and depth, or from pictures alone",
    "check": "list all faults of a sequence, with remedies",
    "train": "train on a sequence folder, or continue a run",
    "simulate": "write a simulated sequence with exact ground truth for `train`",
    "inspect": "test a clip for motion, light, instruments and more, and plan the components that it needs",
    "render": "render pictures and films at any time in [0, 1] from any camera",
    "export": "write .ply files, a point cloud, a slim model, or an interactive page for any browser",
    "evaluate": "evaluate a run or the pictures of any method with baselines, and compare methods",
    "sweep": "execute many runs from one file, on this machine or on a cluster, with a table of results",
    "ablate": "test the paper's claims: components on and off, over seeds, with paired differences",
    "gradcheck": "compare every reverse pass with finite differences",
    "bench": "measure the time of each stage of an iteration, with its lower bound",
    "tradeoff": "measure error against time, and find the best setting within a budget",
    "golden": "golden vectors for ports: judge outputs, run a port, write the reference's outputs",
}

FORMER = {  # commands of earlier versions -> replacement
    "calibrate": "endotsr train --out RUN --calibrate-only",
    "compare": "endotsr evaluate METHOD METHOD ...",
    "completion": "endotsr --completion bash|zsh|fish",
    "view": "endotsr export SCENE --out PAGE.html",
}
