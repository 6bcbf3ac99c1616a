"""Steps and gradients of the examples as graphs: the bits of eager launches."""

import importlib.util
import sys
from pathlib import Path

import pytest

import warp as wp

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
if not EXAMPLES.exists():
    pytest.skip("the examples are not here", allow_module_level=True)


def example(name):
    """The module of an example, which may import its neighbours."""
    key = f"example_{name}"
    if key not in sys.modules:
        spec = importlib.util.spec_from_file_location(key, EXAMPLES / f"{name}.py")
        module = importlib.util.module_from_spec(spec)
        sys.path.insert(0, str(EXAMPLES))
        try:
            spec.loader.exec_module(module)
        finally:
            sys.path.remove(str(EXAMPLES))
        sys.modules[key] = module
    return sys.modules[key]


def cloth(device):
    problem = example("cloth").Cloth(8, 6, device)
    problem.target = wp.zeros((8, 8), dtype=wp.vec3d, device=device)
    problem.wind.assign([(0.3, -0.4, 0.8)])
    return problem.gradient, [*problem.x[1:], *problem.v[1:]], [problem.loss, problem.wind.grad]


def particles(device):
    fountain = example("particles").Fountain(500, device)

    def work():
        fountain.time, fountain.steps = 0.5, 30
        for _ in range(3):
            fountain.step(0.01)

    return work, [fountain.x, fountain.v, fountain.f], []


def spring_rollout(device):
    module = example("spring_rollout")
    net = module.Net(10, device)

    def work():
        with wp.Tape() as tape:
            for k in range(5):
                net.step(k)
            wp.launch(module.height, 1, [net.x], [net.loss], device=device)
        tape.backward(net.loss)

    return work, [net.x, net.v, net.f, net.loss], [net.x.grad, net.v.grad]


def trajectory(device):
    throw = example("trajectory").Throw(device)
    return throw.closure, [throw.flight, throw.loss, throw.velocity.grad], []


@pytest.mark.parametrize("scene", [cloth, particles, spring_rollout, trajectory])
def test_steps_have_the_bits_of_eager_launches(device, scene, monkeypatch):
    """A chain, a graph by dependencies and one with fused launches leave what eager launches do."""
    with wp.ScopedDevice(device):
        work, arrays, sums = scene(device)
        # Threads of a GPU add in no order, in eager launches neither.
        arrays = arrays if wp.get_device(device).is_cuda else [*arrays, *sums]
        everything = [*arrays, *sums]
        start = [array.numpy().copy() for array in everything]

        def after(run):
            for array, values in zip(everything, start, strict=True):
                array.assign(values)
            for _ in range(2):
                run()
            return [array.numpy().copy() for array in arrays]

        expected = after(work)
        assert sum((a != b).any() for a, b in zip(expected, start)) > len(expected) // 2
        for optimize, fuse in ((False, False), (True, False), (True, True)):
            monkeypatch.setattr(wp.config, "fuse_graphs", fuse)
            with wp.ScopedCapture(optimize=optimize) as capture:
                work()
            found = after(lambda graph=capture.graph: wp.capture_launch(graph))
            for a, b in zip(found, expected, strict=True):
                assert a.tobytes() == b.tobytes(), (optimize, fuse)
