"""The checks on ranks by NCCL, one GPU for each rank; gradients and bits are those of one rank."""

import importlib.util

import launcher
import numpy as np
import pytest
import test_ranks

import warp as wp

pytestmark = [
    pytest.mark.skipif(not wp.is_cuda_available(), reason="there is no GPU"),
    pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is not installed"),
]


def found(size):
    if size > wp.get_cuda_device_count():
        pytest.skip(f"{size} ranks need {size} GPUs")
    return launcher.results("nccl", size, "main.py")


@pytest.mark.parametrize("check", test_ranks.PASSING)
@pytest.mark.parametrize("size", [1, 2])
def test_passes_on_gpus(size, check):
    facts = found(size)
    assert check in facts, sorted(facts)
    assert facts[check] is None, facts[check]["error"]


@pytest.mark.parametrize("check", test_ranks.SAME_BITS)
def test_same_bits_on_gpus(check):
    assert "error" not in str(found(1)[check]), found(1)[check]
    assert found(2)[check] == found(1)[check]


def test_captures_and_gradients_of_two_gpus():
    assert isinstance(found(2)["capture"], list), found(2)["capture"]
    assert found(2)["capture"][1] == pytest.approx(found(1)["capture"][1], rel=1e-6)
    alone, both = found(1)["gradient"], found(2)["gradient"]
    for one, other in zip(alone, both, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-6)
