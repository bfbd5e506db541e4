"""`python -m endotsr.definition`: trains the scene of `simulate` and prints its losses and its PSNR."""

import signal

import numpy as np

from endotsr.definition.settings import SMALL
from endotsr.definition.simulate import simulate
from endotsr.definition.train import evaluate, train


def report(state, view):
    """One line every 20 iterations."""
    if state.iteration % 20 == 0 or state.iteration == 1:
        count, terms = state.gaussians.opacity_logit.size, (f"{name} {value:.4f}" for name, value in view.terms.items())
        print(f"iteration {state.iteration:4d}  loss {view.loss:.4f}  Gaussians {count}", *terms, sep="  ", flush=True)


if __name__ == "__main__":
    if hasattr(signal, "SIGPIPE"):  # the end of `... | head`, in place of an error; Windows has none
        signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    sequence = simulate()
    model = train(sequence, SMALL, np.random.default_rng(0), on_iteration=report)
    for name, indices in (("training", sequence.train_index), ("held-out", sequence.test_index)):
        print(f"{name} PSNR over tissue: {evaluate(*model, sequence, SMALL, indices):.2f} dB")
