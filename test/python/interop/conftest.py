"""Fixtures of tests with JAX."""

import pytest

import warp as wp


@pytest.fixture
def place(device):
    """JAX's device; tests run with it as JAX's default."""
    jax = pytest.importorskip("jax")
    try:
        found = wp.device_to_jax(device)
    except RuntimeError:
        pytest.skip(f"JAX has no device for '{device}'")
    with jax.default_device(found):
        yield found
