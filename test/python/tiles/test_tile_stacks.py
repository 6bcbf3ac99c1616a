"""Stacks of a block and random tiles, against what Python does in the order of threads."""

import numpy as np
import pytest

import warp as wp

B = 64


@pytest.fixture(autouse=True)
def blocks(monkeypatch):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@wp.func
def push(s: wp.tile_stack(capacity=48, dtype=int), value: int, wanted: bool):
    return wp.tile_stack_push(s, value, wanted)


@wp.kernel
def push_and_pop(
    values: wp.array(dtype=int),
    slots: wp.array2d(dtype=int),
    popped: wp.array(dtype=int),
    counts: wp.array(dtype=int),
):
    _i, lane = wp.tid()
    s = wp.tile_stack(capacity=48, dtype=int)
    for r in range(2):
        slots[r, lane] = push(s, values[lane] + r, values[lane] % 3 == 0)
        counts[r] = wp.tile_stack_count(s)
    value, slot = wp.tile_stack_pop(s)
    popped[lane] = value
    slots[2, lane] = slot
    counts[2] = wp.tile_stack_count(s)
    wp.tile_stack_clear(s)
    counts[3] = wp.tile_stack_count(s)


def test_stacks(device):
    values = np.random.default_rng(0).integers(1, 1000, B).astype(np.int32)
    slots = wp.zeros((3, B), dtype=int, device=device)
    popped, counts = (wp.zeros(count, dtype=int, device=device) for count in (B, 4))
    inputs = [wp.array(values, device=device), slots, popped, counts]
    wp.launch_tiled(push_and_pop, dim=1, inputs=inputs, block_dim=B, device=device)
    stack, expected = [], np.full((3, B), -1)
    for r in range(2):
        for lane in range(B):
            if values[lane] % 3 == 0 and len(stack) < 48:
                expected[r, lane] = len(stack)
                stack.append(values[lane] + r)
        assert counts.numpy()[r] == len(stack)
    for lane in range(min(B, len(stack))):
        expected[2, lane] = len(stack) - 1 - lane
    np.testing.assert_array_equal(slots.numpy(), expected)
    top = np.array(stack[::-1] + [0] * B)[:B]
    np.testing.assert_array_equal(popped.numpy(), top)
    assert list(counts.numpy()[2:]) == [max(len(stack) - B, 0), 0]


def test_capacities_are_known_and_positive():
    @wp.kernel(enable_backward=False)
    def work(n: int):
        wp.tile_stack(capacity=n, dtype=int)

    with pytest.raises(wp.WarpCodegenError, match=r"positive integer that is known.*") as problem:
        wp.launch_tiled(work, dim=1, inputs=[3], block_dim=B, device="cpu")
    assert "test_tile_stacks.py" in str(problem.value)
    with pytest.raises(ValueError, match="positive integer"):
        wp.tile_stack(capacity=0, dtype=int)


def test_pushed_values_have_the_type_of_the_stack():
    @wp.kernel(enable_backward=False)
    def work():
        s = wp.tile_stack(capacity=4, dtype=int)
        wp.tile_stack_push(s, 1.5, True)

    with pytest.raises(wp.WarpCodegenError, match="does not match the elements"):
        wp.launch_tiled(work, dim=1, inputs=[], block_dim=B, device="cpu")


def random_words(seed, rounds):
    """The generator of `wp.rand_init` and `wp.randi` (PCG), a word and the next state."""
    state = np.asarray(seed, dtype=np.uint32)
    words = []
    with np.errstate(over="ignore"):
        for _ in range(rounds):
            b = state * np.uint32(747796405) + np.uint32(2891336453)
            c = ((b >> ((b >> np.uint32(28)) + np.uint32(4))) ^ b) * np.uint32(277803737)
            state = (c >> np.uint32(22)) ^ c
            words.append(state)
    return words


@wp.kernel
def draw(
    numbers: wp.array2d(dtype=int),
    dice: wp.array(dtype=int),
    parts: wp.array(dtype=float),
    spread: wp.array(dtype=float),
):
    rng = wp.rand_init(7)
    wp.tile_store(numbers, wp.tile_randi(shape=(3, 50), rng=rng))
    wp.tile_store(dice, wp.tile_randi(shape=100, rng=rng, min=1, max=7))
    wp.tile_store(parts, wp.tile_randf(shape=100, rng=rng))
    wp.tile_store(spread, wp.tile_randf(shape=100, rng=rng, min=-2.0, max=3.0))


def test_random_tiles(device):
    numbers = wp.zeros((3, 50), dtype=int, device=device)
    dice = wp.zeros(100, dtype=int, device=device)
    parts, spread = (wp.zeros(100, dtype=float, device=device) for _ in range(2))
    outputs = [numbers, dice, parts, spread]
    wp.launch_tiled(draw, dim=1, inputs=outputs, block_dim=B, device=device)
    (first,) = random_words(7, 1)
    # Each thread begins with the hash of its number plus the state, and draws in turn.
    (begin,) = random_words(np.arange(B, dtype=np.uint32) + first, 1)
    words = np.concatenate(random_words(begin, 3))
    np.testing.assert_array_equal(numbers.numpy().ravel(), words[:150].astype(np.int32))
    np.testing.assert_array_equal(dice.numpy(), words[:100] % 6 + 1)
    fractions = (words[:100] >> 8).astype(np.float64) / 2.0**24
    np.testing.assert_array_equal(parts.numpy(), fractions)
    np.testing.assert_allclose(spread.numpy(), 5 * fractions - 2, atol=1e-6)


@pytest.mark.parametrize(
    ("bounds", "words"),
    [
        ((3, None), "expects the argument 'max'"),
        ((5, 5), "greater than min"),
        ((0.5, 2), "constants of"),
    ],
)
def test_bounds_of_random_tiles(bounds, words):
    low, high = bounds

    @wp.kernel(enable_backward=False)
    def one():
        wp.tile_randi(shape=4, rng=wp.rand_init(1), min=wp.static(low))

    @wp.kernel(enable_backward=False)
    def both():
        wp.tile_randi(shape=4, rng=wp.rand_init(1), min=wp.static(low), max=wp.static(high))

    with pytest.raises(wp.WarpCodegenError, match=words):
        wp.launch_tiled(one if high is None else both, dim=1, inputs=[], block_dim=B, device="cpu")


@wp.kernel
def show(a: wp.array2d(dtype=float)):
    print(wp.tile_load(a, shape=(2, 3)))


def test_printing(capfd):
    given = wp.array(np.arange(6, dtype=np.float32).reshape(2, 3), device="cpu")
    wp.launch_tiled(show, dim=1, inputs=[given], block_dim=B, device="cpu")
    wp.synchronize()
    assert capfd.readouterr().out == "[[0 1 2]\n [3 4 5]] = tile(shape=(2,3), storage=register)\n"
