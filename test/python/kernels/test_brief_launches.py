"""Launches that were brief run on the calling thread, with the same results when they grow."""

import numpy as np

import warp as wp


@wp.kernel
def sum_some(counts: wp.array[int], x: wp.array[float], out: wp.array[float]):
    i = wp.tid()
    total = float(0.0)
    for k in range(counts[i]):
        total += x[k] * float(i + 1)
    out[i] = total


def expected(counts, x):
    """The sums in double precision."""
    sums = np.concatenate([[0.0], np.cumsum(x.astype(np.float64))])
    return sums[counts] * np.arange(1, len(counts) + 1)


def check(launch, counts, x, out, values):
    counts.assign(np.asarray(values, dtype=np.int32))
    out.fill_(-1.0)
    launch()
    wanted = expected(counts.numpy(), x.numpy())
    np.testing.assert_allclose(out.numpy(), wanted, rtol=1e-4, atol=1e-6)


def test_results_when_empty_loops_fill_and_empty_again():
    size, rng = 256, np.random.default_rng(3)
    x = wp.array(rng.random(4096).astype(np.float32), device="cpu")
    counts = wp.zeros(size, dtype=int, device="cpu")
    out = wp.zeros(size, dtype=float, device="cpu")
    arguments = [counts, x, out]
    recorded = wp.launch(sum_some, size, arguments, device="cpu", record_cmd=True)
    for launch in (
        lambda: wp.launch(sum_some, size, arguments, device="cpu"),
        recorded.launch,
    ):
        for _ in range(40):
            launch()
        check(launch, counts, x, out, np.zeros(size))
        for _ in range(3):
            check(launch, counts, x, out, rng.integers(0, 4096, size))
        check(launch, counts, x, out, np.zeros(size))
        for _ in range(40):
            launch()
        check(launch, counts, x, out, rng.integers(0, 4096, size))


def test_arguments_of_a_recorded_launch_change_between_brief_launches():
    size = 256
    x = wp.array(np.ones(8, dtype=np.float32), device="cpu")
    outputs = [wp.zeros(size, dtype=float, device="cpu") for _ in range(2)]
    counts = [wp.full(size, value, dtype=int, device="cpu") for value in (0, 8)]
    command = wp.launch(sum_some, size, [counts[0], x, outputs[0]], device="cpu", record_cmd=True)
    for _ in range(40):
        command.launch()
    command.set_param_at_index(0, counts[1])
    command.set_param_at_index(2, outputs[1])
    command.launch()
    np.testing.assert_array_equal(outputs[0].numpy(), np.zeros(size))
    np.testing.assert_array_equal(outputs[1].numpy(), 8.0 * np.arange(1, size + 1))
