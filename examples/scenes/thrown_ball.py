"""A ball that learns to hit a target after two bounces: one line for each step of the optimiser.

    python examples/scenes/thrown_ball.py [--device cpu] [--frames 24] [--samples 8]

L-BFGS changes the first velocity; its gradient comes from a tape through all time steps and is
checked against central differences in double precision, whose difference is the error.
"""

import numpy as np
from movies import Movie

import warp as wp
from warp.optim import LBFGS

# [s], [m], [m/s]
STEPS, DT, WALL = 480, 1.0 / 480.0, 2.0
START, GUESS, TARGET = (-0.5, 1.0, 0.0), (6.0, -6.0, 0.6), (-2.0, 1.5, 0.9)


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
    up = wp.vec3d(wp.float64(0.0), wp.float64(1.0), wp.float64(0.0))
    left = wp.vec3d(wp.float64(-1.0), wp.float64(0.0), wp.float64(0.0))
    for k in range(steps):
        force = wp.float64(-9.81) * up
        force += contact(-x[1], up, v) + contact(x[0] - wall, left, v)
        v += force * dt
        x += v * dt
        flight[k] = x
    loss[0] = wp.length_sq(x - target)


class Throw:
    """The first velocity, and what becomes of it."""

    def __init__(self, device):
        self.device = device
        self.velocity = wp.array([GUESS], dtype=wp.vec3d, device=device, requires_grad=True)
        self.loss = wp.zeros(1, dtype=wp.float64, device=device, requires_grad=True)
        self.flight = wp.zeros(STEPS, dtype=wp.vec3d, device=device)

    def run(self):
        constants = [wp.vec3d(*START), wp.vec3d(*TARGET), WALL, STEPS, DT]
        outputs = [self.flight, self.loss]
        wp.launch(throw, 1, [self.velocity, *constants], outputs, device=self.device)

    def closure(self):
        with wp.Tape() as tape:
            self.run()
        tape.backward(self.loss)
        return self.loss

    def optimise(self, most=40, near=1e-10):
        """Flights of the first guess and after each step."""
        self.run()
        flights = [np.vstack([START, self.flight.numpy()])]
        optimizer = LBFGS([self.velocity], max_iter=1)
        while len(flights) <= most and float(self.loss.numpy()[0]) > near:
            optimizer.step(self.closure)
            self.run()
            flights.append(np.vstack([START, self.flight.numpy()]))
        return flights, optimizer.evaluations

    def gradient_error(self, step=1e-6):
        """The relative error of the gradient against central differences."""
        self.closure()
        found = self.velocity.grad.numpy()[0].copy()
        self.velocity.grad.zero_()
        slopes = []
        for axis in np.eye(3):
            ends = []
            for sign in (1.0, -1.0):
                self.velocity.assign([np.array(GUESS) + sign * step * axis])
                self.run()
                ends.append(float(self.loss.numpy()[0]))
            slopes.append((ends[0] - ends[1]) / (2.0 * step))
        self.velocity.assign([GUESS])
        return np.abs(found - slopes).max() / np.abs(slopes).max()


def rainbow(share):
    """From deep blue over magenta to gold."""
    stops = np.array([[0.02, 0.05, 0.35], [0.45, 0.03, 0.42], [0.95, 0.22, 0.12], [1.0, 0.75, 0.1]])
    at = share * 3.0
    k = min(int(at), 2)
    return tuple((1.0 - at + k) * stops[k] + (at - k) * stops[k + 1])


def add_room(scene):
    """Floor, wall and target."""
    floor = {"color": (0.75, 0.75, 0.78), "roughness": 0.25, "checker": 0.5}
    scene.add_height_field(np.zeros((2, 2)), (-14.0, -14.0), (WALL, 14.0), **floor)
    corners = [[WALL, 0, -14], [WALL, 0, 14], [WALL, 3.2, 14], [WALL, 3.2, -14]]
    scene.add_mesh(corners, [0, 1, 2, 0, 2, 3], smooth=False, color=(0.35, 0.5, 0.62))
    ring = np.linspace(0.0, 2.0 * np.pi, 65)
    for radius, color in ((0.34, (0.9, 0.08, 0.06)), (0.2, (0.95, 0.95, 0.95))):
        circle = np.stack([0 * ring, radius * np.cos(ring), radius * np.sin(ring)], axis=1)
        scene.add_tubes([circle + TARGET], 0.035, color=color, roughness=0.3)
    scene.add_spheres([TARGET], 0.06, emission=(14, 9, 3))


def main():
    movie = Movie("thrown_ball", __doc__, frames=1, samples=48)
    scene, problem = movie.scene, Throw(movie.device)
    error = problem.gradient_error()
    movie.work = 0.0
    flights, evaluations = movie.timed(problem.optimise)
    add_room(scene)
    scene.set_sky(sun=(-0.5, 0.75, 0.45), power=4.5, size=2.0, ground=(0.7, 0.7, 0.7))
    scene.set_camera((-3.4, 2.1, 5.0), (-0.15, 0.95, 0.2), fov=32.0, aperture=0.015, focus=5.6)
    for number, flight in enumerate(flights):
        color = rainbow(number / max(1, len(flights) - 1))
        last = number + 1 == len(flights)
        scene.add_tubes([flight[::4]], 0.022 if last else 0.011, color=color, roughness=0.25)
        scene.add_spheres([flight[-1]], 0.1 if last else 0.05, color=color, roughness=0.15)
    scene.add_spheres([START], 0.11, color=(0.9, 0.9, 0.9), metallic=1.0, roughness=0.08)
    for frame in range(movie.frames):
        turn = 0.5 * frame / max(1, movie.frames)
        eye = (-3.4 + 2.0 * turn, 2.1, 5.0 + turn)
        scene.set_camera(eye, (-0.15, 0.95, 0.2), fov=32.0, aperture=0.015, focus=5.6)
        movie.add()
    rate = evaluations / movie.work
    movie.finish(rate, "gradients a second", error, "error of the gradient")


if __name__ == "__main__":
    main()
