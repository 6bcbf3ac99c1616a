"""The gradient of 1000 time steps of a spring net, with a few copies of its state.

    python examples/spring_rollout.py [--device cpu]

A net of masses and springs is pushed at the start and swings; asked for is how the place of its
middle at the end depends on all initial velocities. Recording every step keeps every state;
`wp.autograd.checkpoint` keeps a few and runs parts of the rollout again: less memory, more time,
and the same gradient, on a CPU bit by bit, as sums are asked to be the same in every run.
Writes build/demo/spring_rollout_<device>.png.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
SNAPSHOTS = (4, 6, 8, 16, 32, 64, 128)
# Threads add up in any order otherwise.
wp.set_module_options({"deterministic": "run_to_run"})


@wp.func
def pull(x: wp.vec3, other: wp.vec3, rest: float):
    """Force of a spring of unit stiffness towards the other end."""
    d = other - x
    return d * (1.0 - rest / wp.max(wp.length(d), 1.0e-6))


@wp.kernel
def forces(x: wp.array2d[wp.vec3], stiffness: float, rest: float,
           f: wp.array2d[wp.vec3]):  # fmt: skip
    """Springs between neighbours of the net, and gravity; the rim is held."""
    i, j = wp.tid()
    total = wp.vec3()
    if i > 0 and j > 0 and i < x.shape[0] - 1 and j < x.shape[1] - 1:
        p = x[i, j]
        total = pull(p, x[i - 1, j], rest) + pull(p, x[i + 1, j], rest)
        total += pull(p, x[i, j - 1], rest) + pull(p, x[i, j + 1], rest)
        total = stiffness * total + wp.vec3(0.0, 0.0, -1.0)
    f[i, j] = total


@wp.kernel
def integrate(f: wp.array2d[wp.vec3], dt: float, x: wp.array2d[wp.vec3],
              v: wp.array2d[wp.vec3]):  # fmt: skip
    """One step of the symplectic Euler scheme."""
    i, j = wp.tid()
    v1 = v[i, j] + dt * f[i, j]
    v[i, j] = v1
    x[i, j] = x[i, j] + dt * v1


@wp.kernel
def height(x: wp.array2d[wp.vec3], loss: wp.array[float]):
    """Height of the middle of the net."""
    loss[0] = x[x.shape[0] // 2, x.shape[1] // 2][2]


class Net:
    """A square net of n by n masses."""

    def __init__(self, n, device, dt=0.02):
        self.n, self.device, self.dt = n, device, dt
        across = np.linspace(-0.5, 0.5, n, dtype=np.float32)
        flat = np.stack([*np.meshgrid(across, across, indexing="ij"), np.zeros((n, n))], axis=-1)
        kind = {"dtype": wp.vec3, "device": device, "requires_grad": True}
        self.x = wp.array(flat.astype(np.float32), **kind)
        rng = np.random.default_rng(2)
        self.v = wp.array(0.02 * rng.normal(size=(n, n, 3)).astype(np.float32), **kind)
        self.f = wp.zeros((n, n), **kind)
        self.loss = wp.zeros(1, dtype=float, device=device, requires_grad=True)
        self.calls = 0
        self.start = wp.clone(self.x), wp.clone(self.v)

    def reset(self):
        """Back to the start."""
        for values, start in zip((self.x, self.v), self.start):
            values.assign(start)
            values.grad.zero_()

    def step(self, k):
        """Time step number k."""
        self.calls += 1
        shape, rest = (self.n, self.n), 0.9 / (self.n - 1)
        wp.launch(forces, shape, [self.x, 50.0, rest], [self.f], device=self.device)
        wp.launch(integrate, shape, [self.f, self.dt], [self.x, self.v], device=self.device)


def measured(net, steps, snapshots=None):
    """The gradient by the velocities, and what it takes.

    Args:
        snapshots: copies of the state to keep; None records every step.

    Returns:
        (gradient, seconds, peak memory in MiB, time steps run forward)
    """
    net.reset()
    net.calls = 0
    wp.synchronize_device(net.device)
    found: list[str] = []
    with wp.ScopedMemoryTracker("rollout", report_func=found.append) as memory:
        memory.clear()
        begin = time.perf_counter()
        with wp.Tape() as tape:
            if snapshots is None:
                for k in range(steps):
                    net.step(k)
            else:
                wp.autograd.checkpoint(net.step, steps, state=[net.x, net.v], snapshots=snapshots)
            wp.launch(height, 1, [net.x], [net.loss], device=net.device)
        tape.backward(net.loss)
        wp.synchronize_device(net.device)
        seconds = time.perf_counter() - begin
    return net.v.grad.numpy().copy(), seconds, peak(found[0], net.device), net.calls


def peak(report, device):
    """The peak in MiB from the report of a memory tracker."""
    line = next(line for line in report.splitlines() if line.strip().startswith(device))
    number, unit = line.split(",")[1].split()[:2]
    return float(number) * {"bytes": 2.0**-20, "KiB": 2.0**-10, "MiB": 1.0, "GiB": 1024.0}[unit]


def picture(rows, path, title):
    """Work and time against memory, a point per number of snapshots."""
    figure, panels = plt.subplots(1, 2, figsize=(11, 4.6), dpi=150, layout="constrained")
    names, seconds, memory, calls = zip(*rows)
    for axes, values, label in (
        (panels[0], calls, "time steps run forward"),
        (panels[1], seconds, "time of the gradient [s]"),
    ):
        axes.plot(memory[1:], values[1:], "o-", color="#1f6fb4", markerfacecolor="white")
        axes.plot(memory[:1], values[:1], "s", color="black")
        for name, x, y in zip(names, memory, values):
            text = name.removesuffix(" snapshots")
            axes.annotate(text, (x, y), xytext=(5, 6), textcoords="offset points", fontsize=9)
        axes.set(xscale="log", xlabel="peak memory [MiB]", ylabel=label)
        axes.set_ylim(0.0, 1.15 * max(values))
        axes.margins(x=0.15)
        axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(f"{title}: numbers are snapshots")
    figure.savefig(path)
    plt.close(figure)


def demonstrate(device, n, steps, output):
    """Everything for one device."""
    net = Net(n, device)
    measured(net, 2)
    full, seconds, memory, calls = measured(net, steps)
    rows = [("every step", seconds, memory, calls)]
    difference = 0.0
    for count in SNAPSHOTS:
        found, seconds, memory, calls = measured(net, steps, count)
        difference = max(difference, np.abs(found - full).max() / np.abs(full).max())
        if difference > (1.0e-4 if wp.get_device(device).is_cuda else 0.0):
            raise SystemExit(f"the gradient with {count} snapshots differs by {difference:.1e}")
        rows.append((f"{count} snapshots", seconds, memory, calls))
    print(
        f"spring rollout on {device}: {n} x {n} masses, {steps} steps, "
        f"equal gradients (largest difference {difference:.1e})"
    )
    print("\n| kept | peak memory [MiB] | time [s] | steps run forward |\n|---|--:|--:|--:|")
    for name, seconds, memory, calls in rows:
        print(f"| {name} | {memory:.2f} | {seconds:.2f} | {calls} |")
    path = output / f"spring_rollout_{device.replace(':', '')}.png"
    picture(rows, path, f"gradient of {steps} steps of {n * n} masses, {device}")
    return rows


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--masses", type=int, default=48, help="along a side of the net")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the pictures")
    options = parser.parse_args()
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.masses, options.steps, options.output)


if __name__ == "__main__":
    main()
