"""An unsigned index that wraps in a lane that is not there says nothing of the other lanes."""

import numpy as np
import pytest

import warp as wp


@pytest.mark.parametrize("lanes", [1, 8, 16])
@pytest.mark.parametrize("n", [1, 2, 16, 40])
def test_index_of_the_thread_before(device, lanes, n):
    @wp.kernel(module_options={"cpu_lanes": lanes})
    def differences(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        if i > 0:
            before = wp.uint32(i) - wp.uint32(1)
            y[i] = x[i] - x[before]

    values = np.random.default_rng(n).integers(-9, 9, n).astype(np.float32)
    y = wp.zeros(n, dtype=float, device=device)
    wp.launch(differences, n, [wp.array(values, dtype=float, device=device), y], device=device)
    np.testing.assert_array_equal(y.numpy()[1:], np.diff(values))
