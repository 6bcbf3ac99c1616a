"""Programs by PyTorch: the formulas of `_programs`, operation by operation."""

import numpy as np
import torch
from _programs import PROGRAMS as FORMULAS
from _programs import Arrays
from packages import Run

VERSION = f"torch {torch.__version__}"
PROGRAMS = FORMULAS


class TorchArrays(Arrays):
    xp = torch

    def add_at(self, count, index, values):
        found = torch.zeros((count, *values.shape[1:]), dtype=values.dtype, device=values.device)
        return found.index_add(0, index, values)

    def cross(self, a, b):
        return torch.linalg.cross(a, b)

    def indices(self, values):
        return torch.floor(values).to(torch.int32)


def build(name, inputs, weights, device):
    wrt = FORMULAS[name].wrt
    given = {
        key: torch.tensor(value, device=device) if isinstance(value, np.ndarray) else value
        for key, value in inputs.items()
    }
    formula, held = FORMULAS[name].formula, {}

    def wait():
        if device != "cpu":
            torch.cuda.synchronize()

    def forward():
        with torch.no_grad():
            held["result"] = formula(TorchArrays(), **given)
        wait()

    if weights is None:
        return Run(forward, lambda: held["result"].cpu().numpy())
    weights = torch.tensor(weights, device=device)

    def backward():
        source = given[wrt].detach().requires_grad_(True)
        result = formula(TorchArrays(), **{**given, wrt: source})
        (held["gradient"],) = torch.autograd.grad(result, source, weights)
        held["result"] = result.detach()
        wait()

    return Run(
        forward,
        lambda: held["result"].cpu().numpy(),
        backward,
        lambda: held["gradient"].cpu().numpy(),
    )
