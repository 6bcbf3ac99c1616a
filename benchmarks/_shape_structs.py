"""Kernels of shapes.py over structs: structs in structs, arrays of them, results of functions."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


@wp.struct
class Material:
    young: float
    poisson: float
    density: float


@wp.struct
class Grain:
    x: wp.vec3
    v: wp.vec3
    radius: float
    material: Material
    kind: wp.int32


@wp.struct
class Wall:
    normal: wp.vec3
    offset: float
    friction: float


@wp.struct
class Hit:
    depth: float
    normal: wp.vec3
    found: wp.bool


@wp.func
def against(p: wp.vec3, radius: float, wall: Wall):
    hit = Hit()
    hit.depth = radius - (wp.dot(p, wall.normal) - wall.offset)
    hit.normal = wall.normal
    hit.found = hit.depth > 0.0
    return hit


@differentiable
def grains_kernel(
    grains: wp.array(dtype=Grain),
    walls: wp.array(dtype=Wall),
    dt: float,
    out: wp.array(dtype=Grain),
):
    i = wp.tid()
    g = grains[i]
    shear = g.material.young / (2.0 * (1.0 + g.material.poisson))
    mass = g.material.density * 4.0 / 3.0 * wp.pi * g.radius * g.radius * g.radius
    f = wp.vec3(0.0, -9.81 * mass, 0.0)
    for k in range(walls.shape[0]):
        hit = against(g.x, g.radius, walls[k])
        if hit.found:
            push = 4.0 / 3.0 * shear * wp.sqrt(g.radius * hit.depth) * hit.depth
            f += hit.normal * push
            slip = g.v - hit.normal * wp.dot(g.v, hit.normal)
            f -= slip * (walls[k].friction * push / (wp.length(slip) + 1.0e-3))
    g.v = g.v + f * (dt / mass)
    g.x = g.x + g.v * dt
    out[i] = g


def struct_array(data, kind, values, grad=False):
    """An array of structs with these fields."""
    found = np.zeros(len(next(iter(values.values()))), kind.numpy_dtype())
    for name, value in values.items():
        found[name] = value
    return wp.array(found, dtype=kind, device=data.device, requires_grad=grad)


@case
def grains(data):
    """Grains in a box of six walls; grains, walls and materials are structs."""
    n = data.size(1 << 14, 1 << 21)
    values = {name: data.random.random((n, 3), np.float32) for name in ("x", "v")}
    values["radius"] = data.random.uniform(0.05, 0.3, n)
    some = np.zeros(n, Material.numpy_dtype())
    some["young"], some["poisson"], some["density"] = 100.0, 0.3, 10.0
    values["material"] = some
    values["kind"] = np.arange(n)
    eye = np.concatenate([np.eye(3), -np.eye(3)])
    sides = {"normal": eye, "offset": np.repeat([0.0, -1.0], 3), "friction": np.full(6, 0.4)}
    walls = struct_array(data, Wall, sides)
    given = [struct_array(data, Grain, values), walls, 0.001]
    return Case(grains_kernel, n, given, [struct_array(data, Grain, values)], n, "grain")


@wp.struct
class Fields:
    depth: wp.array2d(dtype=float)
    flow: wp.array2d(dtype=wp.vec2)
    ground: wp.array2d(dtype=float)
    dx: float
    gravity: float


@wp.struct
class State:
    h: float
    u: wp.vec2


@wp.func
def state_at(f: Fields, i: int, j: int):
    s = State()
    a = wp.clamp(i, 0, f.depth.shape[0] - 1)
    b = wp.clamp(j, 0, f.depth.shape[1] - 1)
    s.h = f.depth[a, b]
    s.u = f.flow[a, b] / wp.max(s.h, 1.0e-4)
    return s


@wp.func
def flux(left: State, right: State, axis: int, gravity: float):
    a = left.u[axis]
    b = right.u[axis]
    speed = wp.max(wp.abs(a) + wp.sqrt(gravity * left.h), wp.abs(b) + wp.sqrt(gravity * right.h))
    n = wp.vec2(1.0 - float(axis), float(axis))
    mass = 0.5 * (left.h * a + right.h * b) - 0.5 * speed * (right.h - left.h)
    push = 0.25 * gravity * (left.h * left.h + right.h * right.h)
    momentum = (
        (left.u * (left.h * a) + right.u * (right.h * b)) * 0.5
        + n * push
        - (right.u * right.h - left.u * left.h) * (0.5 * speed)
    )
    return wp.vec3(mass, momentum[0], momentum[1])


@forward_only
def shallow_kernel(
    f: Fields, dt: float, depth: wp.array2d(dtype=float), flow: wp.array2d(dtype=wp.vec2)
):
    i, j = wp.tid()
    c = state_at(f, i, j)
    change = flux(state_at(f, i - 1, j), c, 0, f.gravity) - flux(
        c, state_at(f, i + 1, j), 0, f.gravity
    )
    change += flux(state_at(f, i, j - 1), c, 1, f.gravity) - flux(
        c, state_at(f, i, j + 1), 1, f.gravity
    )
    k = dt / f.dx
    depth[i, j] = c.h + k * change[0]
    slope = wp.vec2(
        f.ground[wp.min(i + 1, f.depth.shape[0] - 1), j] - f.ground[wp.max(i - 1, 0), j],
        f.ground[i, wp.min(j + 1, f.depth.shape[1] - 1)] - f.ground[i, wp.max(j - 1, 0)],
    )
    flow[i, j] = c.u * c.h + wp.vec2(change[1], change[2]) * k - slope * (f.gravity * c.h * k * 0.5)


@case
def shallow(data):
    """Shallow water by Rusanov's fluxes; the fields are arrays in a struct."""
    n = data.size(256, 2048)
    f = Fields()
    f.depth = data.real((n, n), low=0.5, grad=False)
    f.flow = data.real((n, n, 2), wp.vec2, -0.5, 0.5, grad=False)
    f.ground = data.real((n, n), grad=False)
    f.dx, f.gravity = 1.0, 9.81
    outs = [data.out((n, n), grad=False), data.out((n, n), wp.vec2, grad=False)]
    return Case(shallow_kernel, (n, n), [f, 0.01], outs, n * n, "cell")
