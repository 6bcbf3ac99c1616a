"""A policy for many worlds at once: simulated by kernels, trained by PyTorch's DDP over ranks.

    python examples/distributed/policy.py [--worlds 256 --iterations 40]
    torchrun --nproc-per-node 2 examples/distributed/policy.py

Each rank has a part of the worlds: carts that are to stop at the origin. Kernels simulate them in a
`torch.autograd.Function`; DDP averages gradients, so `wd.replicate` is left out.
"""

import argparse
import os
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import torch
import torch.distributed as dist

import warp as wp
import warp.distributed as wd

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
STEPS = wp.constant(60)


@wp.kernel
def roll_out(start: wp.array[wp.vec2], gains: wp.array[float], cost: wp.array[float]):
    """A cart with a spring-damper policy; the cost is squared distance and effort."""
    i = wp.tid()
    x = start[i][0]
    v = start[i][1]
    total = float(0.0)
    for _ in range(STEPS):
        u = -gains[0] * x - gains[1] * v
        v = v + 0.05 * u
        x = x + 0.05 * v
        total = total + 0.05 * (x * x + 0.05 * u * u)
    cost[i] = total


class Worlds(torch.autograd.Function):
    """Costs of the worlds of this rank, differentiable in the gains."""

    @staticmethod
    def forward(ctx, start, gains):
        ctx.gains = wp.from_torch(gains.detach().clone(), requires_grad=True)
        ctx.cost = wp.zeros(len(start), dtype=float, device="cpu", requires_grad=True)
        with wp.Tape() as ctx.tape:
            inputs = [wp.from_torch(start, dtype=wp.vec2), ctx.gains, ctx.cost]
            wp.launch(roll_out, len(start), inputs, device="cpu")
        return wp.to_torch(ctx.cost, requires_grad=False).clone()

    @staticmethod
    def backward(ctx, grad):
        ctx.tape.backward(grads={ctx.cost: wp.from_torch(grad.contiguous())})
        return None, wp.to_torch(ctx.gains.grad).clone()


class Policy(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.gains = torch.nn.Parameter(torch.tensor([0.2, 0.0]))

    def forward(self, start):
        return Worlds.apply(start, self.gains)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=256)
    parser.add_argument("--iterations", type=int, default=40)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init("torch" if "RANK" in os.environ else "none", device="cpu")
    generator = torch.Generator().manual_seed(0)
    first, last = wd.rows_of(options.worlds, comm.rank, comm.size)
    start = torch.randn(options.worlds, 2, generator=generator)[first:last].contiguous()
    model = Policy()
    trained = torch.nn.parallel.DistributedDataParallel(model) if comm.size > 1 else model
    optimizer = torch.optim.Adam(model.parameters(), lr=0.15)
    losses = []
    for _ in wd.progress(range(options.iterations), desc="policy", disable=None):
        optimizer.zero_grad()
        loss = trained(start).mean()
        loss.backward()
        optimizer.step()
        whole = wp.array([float(loss.detach()) / comm.size], dtype=wp.float64, device="cpu")
        losses.append(float(wd.all_reduce(whole).numpy()[0]))
    if comm.rank == 0:
        options.output.mkdir(parents=True, exist_ok=True)
        plt.plot(losses)
        plt.xlabel("iteration")
        plt.ylabel("mean cost")
        plt.title(f"{options.worlds} worlds on {comm.size} rank(s)")
        plt.savefig(options.output / "policy.png", dpi=110, bbox_inches="tight")
        gains = ", ".join(f"{g:.4f}" for g in model.gains.detach().tolist())
        print(f"{comm.size} rank(s): cost {losses[0]:.4f} to {losses[-1]:.4f}, gains {gains}")
    if dist.is_initialized():
        dist.destroy_process_group()


if __name__ == "__main__":
    main()
