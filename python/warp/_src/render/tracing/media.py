"""Participating media: distances by delta tracking, transmittance by ratio tracking.

M. Galtier et al., Integral formulation of null-collision Monte Carlo algorithms, JQSRT 125, 2013.
"""

import warp as wp
from warp._src.render.tracing.intersections import FAR, box_span
from warp._src.render.tracing.records import Medium, World

COLLISIONS = wp.constant(4096)


@wp.func
def density_at(medium: Medium, x: wp.vec3):
    d = wp.volume_sample_world(medium.volume, x, wp.Volume.LINEAR)
    return wp.clamp(medium.scale * d, 0.0, medium.majorant)


@wp.func
def collision(medium: Medium, origin: wp.vec3, dir: wp.vec3, most: float, seed: int):
    """The distance to the next collision in a medium, or FAR."""
    span = box_span(origin, dir, medium.low, medium.high)
    last = wp.min(span[1], most)
    t = span[0]
    found = float(FAR)
    if medium.majorant > 0.0 and t < last:
        state = wp.rand_init(seed)
        step = int(0)
        while step < COLLISIONS and t < last:
            t -= wp.log(1.0 - wp.randf(state)) / medium.majorant
            if t < last:
                d = density_at(medium, origin + t * dir)
                if wp.randf(state) * medium.majorant < d:
                    found = t
                    step = COLLISIONS
            step += 1
    return found


@wp.func
def transmittance(world: World, origin: wp.vec3, dir: wp.vec3, most: float, seed: int):
    """The share of light that passes all media between."""
    share = float(1.0)
    for k in range(world.medium_count):
        medium = world.media[k]
        span = box_span(origin, dir, medium.low, medium.high)
        last = wp.min(span[1], most)
        t = span[0]
        if medium.majorant > 0.0 and t < last:
            state = wp.rand_init(seed, k)
            step = int(0)
            while step < COLLISIONS and t < last:
                t -= wp.log(1.0 - wp.randf(state)) / medium.majorant
                if t < last:
                    d = density_at(medium, origin + t * dir)
                    share *= 1.0 - d / medium.majorant
                    if share < 1.0e-3:
                        # Russian roulette keeps the mean.
                        if wp.randf(state) < 0.5:
                            share = 0.0
                            step = COLLISIONS
                        else:
                            share *= 2.0
                step += 1
    return share
