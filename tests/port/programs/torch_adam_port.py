"""PyTorch as a port: `torch.optim.Adam` answers the family adam."""

import torch
from exchange import serve


def answer(operation, inputs, settings):
    """The parameter after the given gradients, and the two moments."""
    if operation != "adam":
        return None
    parameter = torch.nn.Parameter(torch.tensor(inputs["parameter"]))
    s = settings
    optimiser = torch.optim.Adam([parameter], lr=s["rate"], betas=(s["beta1"], s["beta2"]), eps=s["epsilon"])
    for gradient in inputs["gradients"]:
        parameter.grad = torch.tensor(gradient)
        optimiser.step()
    state = optimiser.state[parameter]
    return {
        "parameter_after": parameter.detach().numpy(),
        "first": state["exp_avg"].numpy(),
        "second": state["exp_avg_sq"].numpy(),
    }


if __name__ == "__main__":
    serve(answer)
