"""A ball is thrown so that it hits a target after bouncing off the floor and a wall.

    python examples/trajectory.py [--device cpu]

L-BFGS optimises the initial velocity; the gradient comes from a tape and is checked against central
differences first. Writes build/demo/trajectory_<device>.png: the flight after each iteration.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# [s], [m], [m/s]
STEPS, DT = 480, 1.0 / 480.0
START, GUESS, TARGET = (-0.5, 1.0, 0.0), (6.0, -6.0, 0.0), (-2.0, 1.5, 0.0)
WALL = 2.0


@wp.func
def contact(depth: wp.float64, normal: wp.vec3d, v: wp.vec3d):
    """Acceleration by a surface that the ball touches: a damped spring, and friction."""
    push = wp.vec3d()
    if depth > wp.float64(0.0):
        approach = wp.dot(v, normal)
        pressure = wp.float64(1.0e4) * depth - wp.float64(10.0) * wp.min(approach, wp.float64(0.0))
        slip = v - approach * normal
        speed = wp.sqrt(wp.length_sq(slip) + wp.float64(1.0e-4))
        push = pressure * (normal - wp.float64(0.2) / speed * slip)
    return push


@wp.kernel
def throw(
    velocity: wp.array[wp.vec3d],
    start: wp.vec3d,
    target: wp.vec3d,
    wall: wp.float64,
    steps: int,
    dt: wp.float64,
    flight: wp.array[wp.vec3d],
    loss: wp.array[wp.float64],
):
    """The flight of the ball, and its squared distance from the target at the end [m^2]."""
    x = start
    v = velocity[0]
    for k in range(steps):
        force = wp.vec3d(wp.float64(0.0), wp.float64(-9.81), wp.float64(0.0))
        force += contact(-x[1], wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0)), v)
        force += contact(
            x[0] - wall, wp.vec3d(wp.float64(-1.0), wp.float64(0.0), wp.float64(0.0)), v
        )
        v += force * dt
        x += v * dt
        flight[k] = x
    loss[0] = wp.length_sq(x - target)


class Throw:
    """The optimisation problem on one device."""

    def __init__(self, device):
        self.device = device
        self.velocity = wp.array([GUESS], dtype=wp.vec3d, device=device, requires_grad=True)
        self.loss = wp.zeros(1, dtype=wp.float64, device=device, requires_grad=True)
        self.flight = wp.zeros(STEPS, dtype=wp.vec3d, device=device)

    def run(self):
        """Throws the ball."""
        constants = [wp.vec3d(*START), wp.vec3d(*TARGET), WALL, STEPS, DT]
        outputs = [self.flight, self.loss]
        wp.launch(throw, 1, [self.velocity, *constants], outputs, device=self.device)

    def closure(self):
        """The loss, and its gradient in `velocity.grad`."""
        with wp.Tape() as tape:
            self.run()
        tape.backward(self.loss)
        return self.loss

    def loss_at(self, velocity):
        """The loss of another velocity."""
        self.velocity.assign([velocity])
        self.run()
        return float(self.loss.numpy()[0])


def check_gradient(problem, step=1e-6):
    """Gradient by the tape and by central differences; their relative difference."""
    problem.closure()
    gradient = problem.velocity.grad.numpy()[0].copy()
    problem.velocity.grad.zero_()
    differences = np.zeros(3)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        ahead, behind = (problem.loss_at(np.array(GUESS) + sign * shift) for sign in (1, -1))
        differences[axis] = (ahead - behind) / (2.0 * step)
    problem.velocity.assign([GUESS])
    error = np.abs(gradient - differences).max() / np.abs(gradient).max()
    return gradient, differences, error


def optimise(problem, most=50, near=1e-12):
    """Steps of L-BFGS until the target is hit; flights and losses after each."""
    problem.run()
    flights, losses = [problem.flight.numpy().copy()], [float(problem.loss.numpy()[0])]
    optimizer = wp.optim.LBFGS([problem.velocity], max_iter=1)
    while len(losses) <= most and losses[-1] > near:
        losses.append(optimizer.step(problem.closure))
        flights.append(problem.flight.numpy().copy())
    return flights, losses, optimizer.evaluations


def picture(flights, losses, path, title):
    """The flights, from dark to bright, and the loss of each."""
    figure, (scene, curve) = plt.subplots(
        1, 2, figsize=(11, 4.6), dpi=150, layout="constrained", width_ratios=(3, 2)
    )
    colours = plt.cm.viridis(np.linspace(0.0, 0.95, len(flights)))
    for flight, colour in zip(flights, colours):
        path_of_ball = np.vstack([START, flight])
        scene.plot(path_of_ball[:, 0], path_of_ball[:, 1], color=colour, linewidth=1.3)
    scene.plot(*START[:2], "o", color="#444444", markersize=5)
    scene.plot(*TARGET[:2], "s", color="black", markersize=13)
    scene.axhline(0.0, color="#888888", linewidth=3)
    scene.axvline(WALL, color="#888888", linewidth=3)
    scene.annotate("start", START[:2], xytext=(6, 6), textcoords="offset points")
    scene.annotate("target", TARGET[:2], xytext=(12, 6), textcoords="offset points")
    scene.set(xlabel="x [m]", ylabel="height [m]", aspect="equal", title="flights")
    curve.semilogy(losses, color="#bbbbbb", zorder=0)
    curve.scatter(range(len(losses)), losses, color=colours)
    curve.set(xlabel="iteration", ylabel="squared distance from the target [m²]", title="loss")
    curve.grid(True, color="#dddddd", linewidth=0.6)
    for axes in (scene, curve):
        axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(title)
    figure.savefig(path)
    plt.close(figure)


def demonstrate(device, output):
    """Everything for one device."""
    problem = Throw(device)
    gradient, differences, error = check_gradient(problem)
    print(f"trajectory on {device}")
    print(f"  gradient by the tape      {np.array2string(gradient, precision=8)}")
    print(f"  by central differences    {np.array2string(differences, precision=8)}")
    print(f"  relative difference       {error:.1e}")
    if error > 1e-5:
        raise SystemExit("the gradient is wrong")
    flights, losses, evaluations = optimise(problem)
    miss = np.sqrt(losses[-1])
    print(f"  missed by {np.sqrt(losses[0]):.2f} m at first, by {miss:.1e} m after")
    print(f"  {len(losses) - 1} iterations with {evaluations} evaluations")
    path = output / f"trajectory_{device.replace(':', '')}.png"
    picture(flights, losses, path, f"L-BFGS over {STEPS} time steps with two bounces, {device}")
    return miss


def main():
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", help="one device instead of all, such as cpu or cuda:0")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder of the pictures")
    options = parser.parse_args()
    wp.config.quiet = True
    options.output.mkdir(parents=True, exist_ok=True)
    devices = [options.device] if options.device else [d.alias for d in wp.get_devices()]
    for device in devices:
        demonstrate(device, options.output)


if __name__ == "__main__":
    main()
