"""Costs of a stage that has nothing to do.

    python benchmarks/empty.py [--device cuda:0] [--bodies 40000] [--rounds 40]

A step of a small scene moves bodies; a stage for contacts follows, of which there are none. Python
knows (a launch of no threads), the device knows (a launch of as many threads as there is room, each
of which asks the count), or a graph asks the count before the stage. Shown is what each adds to a
step without the stage, the fastest of interleaved rounds; the goal is 5 %.
"""

import argparse
import time

import warp as wp

STEPS = 20


@wp.kernel
def move(x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), dt: float):
    i = wp.tid()
    v[i] -= wp.vec3(0.0, 9.81 * dt, 0.0)
    x[i] += v[i] * dt


@wp.kernel
def push(
    pairs: wp.array2d(dtype=int),
    count: wp.array(dtype=int),
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    if i >= count[0]:
        return
    a, b = pairs[i, 0], pairs[i, 1]
    away = wp.normalize(x[a] - x[b])
    wp.atomic_add(v, a, away)
    wp.atomic_sub(v, b, away)


class Scene:
    """Bodies and room for as many contacts."""

    def __init__(self, bodies, device):
        self.bodies, self.device = bodies, device
        self.x, self.v = (wp.zeros(bodies, dtype=wp.vec3, device=device) for _ in range(2))
        self.count = wp.zeros(1, dtype=int, device=device)
        self.pairs = wp.zeros((bodies, 2), dtype=int, device=device)

    def move(self):
        wp.launch(move, self.bodies, [self.x, self.v, 1e-3], device=self.device)

    def push(self, contacts):
        inputs = [self.pairs, self.count, self.x, self.v]
        wp.launch(push, contacts, inputs, device=self.device)

    def replayed(self, stage):
        """A function that replays the graph of a step with this stage."""
        with wp.ScopedCapture(device=self.device) as capture:
            self.move()
            stage()
        return lambda: wp.capture_launch(capture.graph)


def seconds(step, device):
    """The time of one step, the device included."""
    wp.synchronize_device(device)
    begin = time.perf_counter()
    for _ in range(STEPS):
        step()
    wp.synchronize_device(device)
    return (time.perf_counter() - begin) / STEPS


def measure(scene, rounds):
    """Seconds of a step by name."""
    full = scene.bodies

    def asked():
        wp.capture_if(scene.count, on_true=lambda: scene.push(full))

    def step(contacts):
        scene.move()
        scene.push(contacts)

    steps = {
        "launched: no stage": scene.move,
        "launched: no threads": lambda: step(0),
        "launched: count on the device": lambda: step(full),
        "graph: no stage": scene.replayed(lambda: None),
        "graph: no threads": scene.replayed(lambda: scene.push(0)),
        "graph: count on the device": scene.replayed(lambda: scene.push(full)),
        "graph: asked before the stage": scene.replayed(asked),
    }
    times = {name: [] for name in steps}
    for one in steps.values():
        seconds(one, scene.device)
    for _ in range(rounds):
        for name, one in steps.items():
            times[name].append(seconds(one, scene.device))
    return {name: min(values) for name, values in times.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--bodies", type=int, default=40_000)
    parser.add_argument("--rounds", type=int, default=40)
    options = parser.parse_args()
    wp.config.quiet = True
    found = measure(Scene(options.bodies, options.device), options.rounds)
    print(f"{options.bodies} bodies on {options.device}\n{'':32}{'us a step':>10}{'added':>9}")
    for name, time_of in found.items():
        without = found[name.partition(":")[0] + ": no stage"]
        print(f"{name:32}{time_of * 1e6:10.2f}{time_of / without - 1.0:9.1%}")


if __name__ == "__main__":
    main()
