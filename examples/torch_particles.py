"""PyTorch and kernels on the same memory: a cloud of particles around moving attractors.

PyTorch holds the state and does what it is good at (random numbers, reductions, matrix products);
a kernel does the part with a loop per particle. Nothing is copied between them.

    python examples/torch_particles.py [--device cuda:0] [--steps 200]
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
def advance(
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    attractors: wp.array[wp.vec3],
    dt: float,
):
    i = wp.tid()
    force = wp.vec3()
    for k in range(attractors.shape[0]):
        d = attractors[k] - x[i]
        force += d / (wp.dot(d, d) + 0.1)
    v[i] = (v[i] + force * dt) * 0.995
    x[i] = x[i] + v[i] * dt


def rotation(angle: float) -> torch.Tensor:
    c, s = torch.cos(torch.tensor(angle)), torch.sin(torch.tensor(angle))
    return torch.tensor([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def main(device: str, count: int, steps: int) -> torch.Tensor:
    torch.manual_seed(0)
    positions = torch.randn(count, 3, device=device) * 3.0
    velocities = torch.zeros(count, 3, device=device)
    attractors = torch.eye(3, device=device) * 2.0
    turn = rotation(0.02).to(device)

    # Views of the tensors' memory; they stay valid for all steps.
    x = wp.from_torch(positions, dtype=wp.vec3)
    v = wp.from_torch(velocities, dtype=wp.vec3)
    a = wp.from_torch(attractors, dtype=wp.vec3)
    for step in range(steps):
        wp.launch(advance, dim=count, inputs=[x, v, a, 0.01], device=device)
        attractors.copy_(attractors @ turn.T)
        if step % 50 == 0:
            radius = positions.norm(dim=1).mean().item()
            print(f"step {step:4d}: mean distance from the origin {radius:.3f}")
    return positions


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cuda:0" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=200)
    options = parser.parse_args()
    main(options.device, options.count, options.steps)
