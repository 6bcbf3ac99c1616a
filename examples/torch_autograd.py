"""A kernel as a layer of a PyTorch model: bumps are moved until their sum looks like a picture.

`torch.autograd.Function` gets the forward launch and, as its backward, the adjoint launch of the
same kernel. Tensors and arrays share memory, and PyTorch's optimiser never knows.

    python examples/torch_autograd.py [--device cuda:0] [--steps 300]
"""

import argparse
import sys

try:
    import torch
except ModuleNotFoundError:
    print("skipped: this example needs PyTorch")
    sys.exit()

import warp as wp


@wp.kernel
def sum_bumps(
    points: wp.array[wp.vec2],
    centers: wp.array[wp.vec2],
    heights: wp.array[float],
    out: wp.array[float],
):
    i = wp.tid()
    total = float(0.0)
    for k in range(centers.shape[0]):
        d = points[i] - centers[k]
        total += heights[k] * wp.exp(-8.0 * wp.dot(d, d))
    out[i] = total


class SumBumps(torch.autograd.Function):
    """Heights of the surface at the points, with derivatives for centers and heights."""

    @staticmethod
    def forward(ctx, points, centers, heights):
        out = torch.empty(len(points), device=points.device)
        ctx.save_for_backward(points, centers, heights, out)
        given = arrays(points, centers, heights, out)
        wp.launch(sum_bumps, len(points), given, device=str(out.device))
        return out

    @staticmethod
    def backward(ctx, gradient):
        points, centers, heights, out = ctx.saved_tensors
        found = torch.zeros_like(centers), torch.zeros_like(heights)
        # The launch adds to the first and uses up the last, which belongs to PyTorch.
        seed = gradient.clone(memory_format=torch.contiguous_format)
        wp.launch(
            sum_bumps,
            len(points),
            arrays(points, centers, heights, out),
            adj_inputs=[None, *arrays(None, *found, seed)[1:]],
            adjoint=True,
            device=str(out.device),
        )
        return None, *found


def arrays(points, centers, heights, out):
    """Views of the tensors' memory, as the kernel wants them."""
    types = (wp.vec2, wp.vec2, float, float)
    return [
        None if tensor is None else wp.from_torch(tensor.detach(), dtype=dtype)
        for tensor, dtype in zip((points, centers, heights, out), types, strict=True)
    ]


def picture(points: torch.Tensor) -> torch.Tensor:
    """A ring."""
    return torch.exp(-20.0 * (points.norm(dim=1) - 0.6) ** 2)


def main(device: str, bumps: int, steps: int) -> float:
    torch.manual_seed(0)
    axis = torch.linspace(-1.0, 1.0, 64, device=device)
    points = torch.stack(torch.meshgrid(axis, axis, indexing="xy"), dim=-1).reshape(-1, 2)
    target = picture(points)
    centers = torch.nn.Parameter(torch.randn(bumps, 2, device=device) * 0.4)
    heights = torch.nn.Parameter(torch.full((bumps,), 0.1, device=device))
    optimizer = torch.optim.Adam([centers, heights], lr=0.02)
    loss = torch.zeros(())
    for step in range(steps):
        optimizer.zero_grad()
        loss = torch.mean((SumBumps.apply(points, centers, heights) - target) ** 2)
        loss.backward()
        optimizer.step()
        if step % 50 == 0:
            print(f"step {step:4d}: mean square error {loss.item():.6f}")
    print(f"after {steps} steps: {loss.item():.6f}")
    return loss.item()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cuda:0" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--bumps", type=int, default=24)
    parser.add_argument("--steps", type=int, default=300)
    options = parser.parse_args()
    main(options.device, options.bumps, options.steps)
