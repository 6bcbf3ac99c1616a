"""Annotations that are strings, as `from __future__ import annotations` makes them."""

from __future__ import annotations

import warp as wp


@wp.struct
class Particle:
    position: wp.vec3
    weights: wp.array(dtype=float)


def test_module_level():
    assert Particle.vars["position"].type is wp.vec3
    assert Particle.vars["weights"].type == wp.array(dtype=float)


def test_local_names():
    vec5 = wp.types.vector(5, float)

    @wp.struct
    class Local:
        state: vec5
        particle: Particle

    assert Local.vars["state"].type is vec5
    assert Local().particle.position == (0, 0, 0)
