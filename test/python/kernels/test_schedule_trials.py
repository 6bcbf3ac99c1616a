"""Schedules of GPUs are compared with the plain mapping while a kernel is launched.

Without a GPU the programs run on the driver of the unit tests, whose launches take as long as the
test says.
"""

import pytest

import programs
import warp as wp

PROGRAM = """
import time
import numpy as np
import warp as wp

wp.config.check_schedules = {check}

@wp.kernel(module="unique", module_options={options})
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 2.0 * x[i] + 1.0

x = wp.array(np.arange(1 << 22), dtype=float, device="cuda:0")
y = wp.zeros_like(x)

def measured():
    text = str(scale.schedule("cuda:0"))
    return [line for line in text.splitlines() if line.strip().startswith("measured")]

def launches(count):
    for _ in range(count):
        wp.launch(scale, len(x), [x, y], device="cuda:0")
    wp.synchronize_device("cuda:0")

end = time.monotonic() + 60
while not measured() and time.monotonic() < end:
    launches(100)
    {body}
print(*measured())
if {real}:
    np.testing.assert_array_equal(y.numpy(), 2.0 * np.arange(1 << 22, dtype=np.float32) + 1.0)
"""


@pytest.fixture
def run(tmp_path):
    def run(check=True, options="{}", body="time.sleep(0.2)", program=PROGRAM, **environment):
        real = wp.is_cuda_available()
        if not real:
            if not programs.FAKE_CUDA.exists():
                pytest.skip("needs a GPU, or the driver that the unit tests are built with")
            environment["WARP_CUDA_DRIVER"] = programs.FAKE_CUDA
        path = programs.write_program(
            program.format(check=check, options=options, body=body, real=real)
        )
        status, out, err = programs.run(path, WARP_CACHE_PATH=tmp_path / "cache", **environment)
        assert status == 0, err
        return out

    return run


def test_both_times_are_told(run):
    out = run()
    assert "the schedule took" in out and "the plain mapping" in out


@pytest.mark.skipif(wp.is_cuda_available(), reason="a card has times of its own")
def test_the_quicker_code_stays_and_is_remembered(run):
    """More blocks are quicker here, and the plain mapping has most."""
    assert "plain" in run(FAKE_CUDA_FAST_BLOCKS="1").split()[1]
    # The next process knows it before it has launched anything.
    out = run(body="break", FAKE_CUDA_FAST_BLOCKS="1")
    assert "plain" in out.split()[1]


@pytest.mark.parametrize(("check", "options"), [(False, "{}"), (True, "{'deterministic': True}")])
def test_nothing_is_timed(run, check, options):
    assert run(check, options, body="time.sleep(0.5); break").strip() == ""


def test_nothing_is_timed_while_a_graph_records(run):
    """Launches that a graph records are not compared; those around it are."""
    body = """
    for _ in range(40):
        with wp.ScopedCapture(device="cuda:0"):
            for _ in range(10):
                wp.launch(scale, len(x), [x, y], device="cuda:0")
    print("recorded", *measured())
    launches(100)
    time.sleep(0.2)
"""
    program = PROGRAM.replace("    launches(100)\n    {body}", "    {body}")
    out = run(body=body, program=program)
    assert out.splitlines()[0].strip() == "recorded"
    assert "the schedule took" in out.splitlines()[-1]


@pytest.mark.skipif(wp.is_cuda_available(), reason="needs two cards of different names")
def test_cards_are_compared_for_themselves(run):
    """Times on one card say nothing of launches on another, which may be slower."""
    body = """
    time.sleep(0.2)
    if measured():
        z = x.to("cuda:1")
        wp.launch(scale, len(z), [z, wp.zeros_like(z)], device="cuda:1")
        print(str(scale.schedule("cuda:1")).count("measured"))
"""
    assert run(body=body, FAKE_CUDA_CARDS="1").splitlines()[0] == "0"
    assert run(body=body).splitlines()[0] == "1"
