"""Work and precision of the two time-stepping schemes: error against run time.

A droplet cloud flies for one second in a gusty wind with linear drag. Step sizes sweep three
decades, in single and in double precision, with a mild and with a stiff drag; the error is taken
against the exact solution. A run whose error passes 100 %, or that is no longer finite, counts
as unstable.
"""

import csv
import itertools
import math
import statistics
import time
from dataclasses import asdict, dataclass

import numpy as np
from tqdm import tqdm

import warp as wp
from particles_kernels import exact_flight, make_kernels

GRAVITY = (0.0, -9.81, 0.0)
WIND = (3.0, 0.0, 1.5)
GUST = 4.0 * math.pi
END_TIME = 1.0
STEP_SIZES = tuple(np.logspace(-1.0, -4.0, 7))
DRAGS = {"mild drag": 0.5, "stiff drag": 150.0}
SCHEMES = {"semi-implicit Euler": 1, "explicit midpoint": 2}
PRECISIONS = {"float32": wp.float32, "float64": wp.float64}
ROUNDING_FLOOR = {"float32": 3e-5, "float64": 1e-11}


@dataclass
class Run:
    """One point of the diagram.

    Attributes:
        error: relative error of the final positions, root mean square; NaN where unstable.
        seconds: shortest wall time of the whole flight.
        stable: whether the run ended finite and with an error below 100 %.
    """

    drag: str
    scheme: str
    precision: str
    step_size: float
    steps: int
    seconds: float
    error: float
    stable: bool


class Flight:
    """A cloud of droplets on one device, in one precision."""

    def __init__(self, device, precision, count, seed=7):
        rng = np.random.default_rng(seed)
        self.device = device
        self.kernels = make_kernels(PRECISIONS[precision])
        # Both precisions start from the same single-precision numbers, so that the error
        # is that of the integration alone.
        start = [
            rng.normal(0.0, 0.1, (count, 3)),
            rng.normal((0.0, 12.0, 0.0), 2.0, (count, 3)),
            rng.uniform(0.5, 2.0, count),
        ]
        self.x0, self.v0, self.w0 = (a.astype(np.float32).astype(np.float64) for a in start)
        vec3, real = self.kernels.vec3, self.kernels.real
        self.x = wp.array(self.x0, dtype=vec3, device=device)
        self.v = wp.array(self.v0, dtype=vec3, device=device)
        self.w = wp.array(self.w0, dtype=real, device=device)
        self.f = wp.zeros(count, dtype=vec3, device=device)
        self.start_x, self.start_v = wp.clone(self.x), wp.clone(self.v)

    def fly(self, scheme, k, steps):
        """Integrate from the start to END_TIME; the wall time in seconds."""
        wp.copy(self.x, self.start_x)
        wp.copy(self.v, self.start_v)
        kernels, vec3 = self.kernels, self.kernels.vec3
        n, dt, gravity = self.w.shape[0], END_TIME / steps, vec3(*GRAVITY)
        # The wind at 0, dt/2, dt, ...: made before the clock starts.
        swing = np.cos(GUST * 0.5 * dt * np.arange(2 * steps))
        wind = [vec3(*sample) for sample in np.outer(swing, WIND)]
        wp.synchronize_device(self.device)
        begin = time.perf_counter()
        for i in range(steps):
            if scheme == "semi-implicit Euler":
                inputs = [self.v, k, wind[2 * i]]
                wp.launch(kernels.drag, n, inputs, [self.f], device=self.device)
                inputs = [self.x, self.v, self.f, self.w, gravity, dt]
                wp.launch(kernels.integrate, n, inputs, device=self.device)
            else:
                inputs = [self.x, self.v, self.w, k, wind[2 * i], wind[2 * i + 1], gravity, dt]
                wp.launch(kernels.midpoint, n, inputs, device=self.device)
        wp.synchronize_device(self.device)
        return time.perf_counter() - begin

    def error(self, k):
        """Relative root-mean-square error of the positions at END_TIME."""
        rate = k * self.w0
        exact, _ = exact_flight(self.x0, self.v0, rate, WIND, GUST, GRAVITY, END_TIME)
        with np.errstate(all="ignore"):
            difference = self.x.numpy().astype(np.float64) - exact
            return float(np.linalg.norm(difference) / np.linalg.norm(exact))


def sweep(device, count, step_sizes=STEP_SIZES, repeats=3, budget=0.4):
    """Run every combination; a list of `Run`.

    Short runs are repeated (at most `repeats` times within `budget` seconds) and the
    shortest time is kept.
    """
    runs = []
    total = len(PRECISIONS) * len(DRAGS) * len(SCHEMES) * len(step_sizes)
    with tqdm(total=total, desc=f"work-precision on {device}", unit="run") as bar:
        for precision in PRECISIONS:
            flight = Flight(device, precision, count)
            for drag, k in DRAGS.items():
                for scheme in SCHEMES:
                    flight.fly(scheme, k, 1)
                    for step_size in step_sizes:
                        steps = max(1, round(END_TIME / step_size))
                        times = [flight.fly(scheme, k, steps)]
                        while len(times) < repeats and sum(times) < budget:
                            times.append(flight.fly(scheme, k, steps))
                        error = flight.error(k)
                        stable = math.isfinite(error) and error < 1.0
                        runs.append(
                            Run(
                                drag,
                                scheme,
                                precision,
                                END_TIME / steps,
                                steps,
                                min(times),
                                error if stable else math.nan,
                                stable,
                            )
                        )
                        bar.update()
    return runs


def curves(runs):
    """Group runs: {(drag, scheme, precision): [Run by falling step size]}."""
    groups: dict[tuple, list] = {}
    for run in runs:
        groups.setdefault((run.drag, run.scheme, run.precision), []).append(run)
    return groups


def time_to_reach(group, goal):
    """Run time at which a curve first reaches the error `goal`, or None if it never does.

    Interpolates linearly in the logarithms between the two runs around the goal.
    """
    stable = [run for run in group if run.stable and run.error > 0.0]
    for index, run in enumerate(stable):
        if run.error <= goal:
            if index == 0:
                return run.seconds
            before = stable[index - 1]
            part = math.log(goal / before.error) / math.log(run.error / before.error)
            return before.seconds * (run.seconds / before.seconds) ** part
    return None


def observed_order(group):
    """Slope of log(error) over log(dt) in the asymptotic part, or None.

    Median over neighbouring runs whose errors lie between the rounding floor and 10 %.
    """
    floor = ROUNDING_FLOOR[group[0].precision]
    slopes = []
    for a, b in itertools.pairwise(group):
        if a.stable and b.stable and floor < b.error < a.error < 0.1:
            slopes.append(math.log(a.error / b.error) / math.log(a.step_size / b.step_size))
    return statistics.median(slopes) if slopes else None


def table(runs, goals=(1e-2, 1e-3, 1e-6)):
    """Markdown: the errors of the sweep and the time to reach given errors."""

    def cell(run):
        return f"{run.error:.1e}" if run.stable else "✗"

    def reach(group, goal):
        seconds = time_to_reach(group, goal)
        return "never" if seconds is None else f"{1e3 * seconds:.2f}"

    groups = curves(runs)
    sizes = [run.step_size for run in next(iter(groups.values()))]
    head = [f"dt={size:.1e} s" for size in sizes]
    lines = ["Relative error of the positions after 1 s (✗ unstable)", ""]
    lines += ["| drag | scheme | precision | order | " + " | ".join(head) + " |"]
    lines += ["|---|---|---|---|" + "---|" * len(head)]
    for (drag, scheme, precision), group in groups.items():
        order = observed_order(group)
        name = f"| {drag} | {scheme} | {precision} | {'-' if order is None else f'{order:.2f}'} | "
        lines.append(name + " | ".join(map(cell, group)) + " |")
    lines += ["", "Run time in milliseconds to reach an error", ""]
    lines += ["| drag | scheme | precision | " + " | ".join(f"{g:.0e}" for g in goals) + " |"]
    lines += ["|---|---|---|" + "---|" * len(goals)]
    for (drag, scheme, precision), group in groups.items():
        cells = " | ".join(reach(group, goal) for goal in goals)
        lines.append(f"| {drag} | {scheme} | {precision} | {cells} |")
    return "\n".join(lines)


def write_csv(runs, path):
    """One line per run."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(asdict(runs[0])))
        writer.writeheader()
        writer.writerows(asdict(run) for run in runs)
