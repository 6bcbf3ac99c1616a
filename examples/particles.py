"""A fountain of a million droplets, and how exactly and how fast it is computed.

    python examples/particles.py [--device cpu] [--particles 1000000] [--quick]

Runs on every device there is and writes to build/demo/, per device,
    fountain_<device>.png          the droplets, seen from the side
    work_precision_<device>.png    error against step size and against run time
    work_precision_<device>.csv    the same as numbers
    report_<device>.md             what the terminal shows
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tqdm import tqdm

import particles_precision as precision
import warp as wp
from particles_kernels import emit, make_kernels
from particles_plots import fountain, work_precision

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# `integrate` reads x, v, f (vec3) and w, and writes x and v.
BYTES_PER_PARTICLE = 5 * 12 + 4


class Fountain:
    """Droplets that fly from nine jets and return to them from the basin.

    Droplets differ in mass, so that the wind sorts them: fine spray drifts away.
    """

    gravity = wp.vec3(0.0, -9.81, 0.0)
    wind = wp.vec3(0.8, 0.0, 0.0)
    drag = 0.35
    jets = 9
    speed = 12.0

    def __init__(self, count, device, seed=1):
        rng = np.random.default_rng(seed)
        self.count, self.device = count, device
        self.kernels = make_kernels(wp.float32)
        below = np.tile(np.array((0.0, -1.0, 0.0), dtype=np.float32), (count, 1))
        self.x = wp.array(below, dtype=wp.vec3, device=device)
        self.v = wp.zeros(count, dtype=wp.vec3, device=device)
        self.f = wp.zeros(count, dtype=wp.vec3, device=device)
        mass = rng.lognormal(0.0, 0.5, (count,)).astype(np.float32)
        self.w = wp.array(1.0 / mass, dtype=float, device=device)
        self.start = wp.array(
            rng.uniform(0.0, 2.2, (count,)).astype(np.float32), dtype=float, device=device
        )
        self.time, self.steps = 0.0, 0

    def integrate(self, dt):
        """Launch the integration kernel alone."""
        inputs = [self.x, self.v, self.f, self.w, self.gravity, dt]
        wp.launch(self.kernels.integrate, self.count, inputs, device=self.device)

    def step(self, dt):
        """Advance by `dt` seconds: emit, drag, integrate."""
        inputs = [self.x, self.v, self.start, self.time, dt, self.steps, self.jets, self.speed]
        wp.launch(emit, self.count, inputs, device=self.device)
        wp.launch(
            self.kernels.drag,
            self.count,
            [self.v, self.drag, self.wind],
            [self.f],
            device=self.device,
        )
        self.integrate(dt)
        self.time += dt
        self.steps += 1


def shortest_time(function, device, repeats=50):
    """Shortest wall time of `function` in seconds, each call synchronised."""
    times = []
    for _ in range(repeats):
        wp.synchronize_device(device)
        begin = time.perf_counter()
        function()
        wp.synchronize_device(device)
        times.append(time.perf_counter() - begin)
    return min(times)


def bandwidth(simulation):
    """Bytes per second of `integrate` and of a device-to-device copy of as many bytes."""
    device = simulation.device
    moved = BYTES_PER_PARTICLE * simulation.count
    source = wp.zeros(moved // 8, dtype=float, device=device)
    target = wp.zeros_like(source)
    copy = 8 * source.shape[0] / shortest_time(lambda: wp.copy(target, source), device)
    # dt = 0 leaves the particles where they are.
    kernel = moved / shortest_time(lambda: simulation.integrate(0.0), device)
    return kernel, copy


def compile_once(device):
    """First launch of `integrate` in this process, after another kernel has woken it up."""
    simulation = Fountain(1, device)
    v, f = (wp.zeros(1, dtype=wp.vec3d, device=device) for _ in range(2))
    wp.launch(make_kernels(wp.float64).drag, 1, [v, 0.0, wp.vec3d()], [f], device=device)
    wp.synchronize_device(device)
    begin = time.perf_counter()
    simulation.integrate(0.0)
    wp.synchronize_device(device)
    return time.perf_counter() - begin


def compile_times(device):
    """First launch in seconds in a fresh process: (empty cache, filled cache)."""
    command = [sys.executable, __file__, "--device", device, "--compile-once"]
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"WARP_CACHE_PATH": cache}
        runs = [
            subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
            for _ in range(2)
        ]
    return tuple(float(run.stdout.split()[-1]) for run in runs)


def demonstrate(device, options, step_sizes):
    """Everything for one device; the report as Markdown."""
    particles, output = options.particles, options.output
    name = device.replace(":", "")
    cold, warm = compile_times(device)
    simulation = Fountain(particles, device)
    simulation.step(0.0)
    wp.synchronize_device(device)
    begin = time.perf_counter()
    steps = round(options.duration / options.dt)
    for _ in tqdm(range(steps), desc=f"fountain on {device}", unit="step"):
        simulation.step(options.dt)
    wp.synchronize_device(device)
    seconds = time.perf_counter() - begin
    rate = simulation.steps * particles / seconds
    kernel, copy = bandwidth(simulation)

    title = f"{particles:,} droplets after {simulation.time:.1f} s on {device}"
    fountain(simulation.x.numpy(), simulation.v.numpy(), output / f"fountain_{name}.png", title)
    runs = precision.sweep(device, options.cloud, step_sizes)
    precision.write_csv(runs, output / f"work_precision_{name}.csv")
    work_precision(
        runs,
        output / f"work_precision_{name}.png",
        f"{options.cloud:,} droplets with drag, 1 s on {device}: error against exact solution",
    )
    report = "\n".join(
        [
            f"## {device} ({wp.get_device(device).name})",
            "",
            "| | |",
            "|---|---|",
            f"| first launch of `integrate`, empty cache | {1e3 * cold:.1f} ms |",
            f"| first launch of `integrate`, from the cache | {1e3 * warm:.1f} ms |",
            f"| fountain, {simulation.steps} steps of 3 kernels | {seconds:.2f} s,"
            f" {rate / 1e6:.0f} M particle steps per second |",
            f"| `integrate`, {BYTES_PER_PARTICLE} bytes per particle | {kernel / 1e9:.1f} GB/s |",
            f"| memory copy (read + written) | {copy / 1e9:.1f} GB/s |",
            f"| share of the copy's bandwidth | {kernel / copy:.0%} |",
            "",
            precision.table(runs),
            "",
        ]
    )
    (output / f"report_{name}.md").write_text(report, encoding="utf-8")
    return report


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--particles", type=int, default=1_000_000)
    parser.add_argument("--duration", type=float, default=4.0, help="of the fountain [s]")
    parser.add_argument("--dt", type=float, default=1.0 / 120.0, help="of the fountain [s]")
    parser.add_argument("--cloud", type=int, default=16384, help="droplets of the error study")
    parser.add_argument("--quick", action="store_true", help="a small run that takes seconds")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the pictures")
    parser.add_argument("--compile-once", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()

    wp.config.quiet = True
    wp.init()
    if options.compile_once:
        print(compile_once(options.device))
        return
    step_sizes = precision.STEP_SIZES
    if options.quick:
        options.particles, options.duration, options.cloud = 20_000, 1.5, 512
        step_sizes = step_sizes[:5]
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        print(demonstrate(device, options, step_sizes))
    print(f"pictures and tables: {options.output}")


if __name__ == "__main__":
    main()
