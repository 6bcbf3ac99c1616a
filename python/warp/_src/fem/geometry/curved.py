"""Inverse maps and closest points of curved cells, by Newton's method and projected steps."""

from types import SimpleNamespace

import warp as wp
from warp._src.fem.geometry.shapes import DIMENSIONS, cell_of
from warp._src.fem.types import coords_type, make_free_sample

_STEPS, _PROJECTED_STEPS = 32, 64
_EPSILON = {wp.float32: 2.0**-23, wp.float64: 2.0**-52}


def parameter_functions(cell: str, real) -> SimpleNamespace:
    """Functions between coordinates and parameters of a reference cell, and into the cell."""
    k, Coords = DIMENSIONS[cell], coords_type(real)
    params = wp.types.vector(k, real)
    is_triangle, is_simplex = cell == "triangle", cell in ("triangle", "tet")
    shift = 1 if is_triangle else 0
    zero, one = real(0.0), real(1.0)

    @wp.func
    def to_params(c: Coords):
        p = params()
        for i in range(k):
            p[i] = c[i + shift]
        return p

    @wp.func
    def to_coords(p: params):
        c = Coords()
        for i in range(k):
            c[i + shift] = p[i]
        if wp.static(is_triangle):
            c[0] = one - p[0] - p[1]
        return c

    @wp.func
    def slack(p: params):
        """Least distance from the faces, negative outside."""
        low = wp.min(p)
        if wp.static(is_simplex):
            total = zero
            for i in range(k):
                total += p[i]
            return wp.min(low, one - total)
        else:
            return wp.min(low, one - wp.max(p))

    @wp.func
    def project(p: params):
        """The nearest point of the reference cell."""
        q = wp.max(p, params())
        if wp.static(is_simplex):
            # On the slanted face: as much from each positive component.
            for _i in range(k):
                total = zero
                count = zero
                for i in range(k):
                    total += q[i]
                    count += wp.where(q[i] > zero, one, zero)
                if total > one:
                    excess = (total - one) / count
                    for i in range(k):
                        q[i] = wp.where(q[i] > zero, wp.max(q[i] - excess, zero), zero)
            return q
        else:
            return wp.min(q, params(one))

    return SimpleNamespace(to_params=to_params, to_coords=to_coords, slack=slack, project=project)


def curved_functions(Arg, position, gradient, inverse, cell: str, d: int, real):
    """Functions of (argument, element, position): coordinates, (coordinates, squared distance) of
    the closest point, and (coordinates, is inside)."""
    vector, Coords = wp.types.vector(d, real), coords_type(real)
    of = parameter_functions(cell, real)
    to_params, to_coords, slack, project = of.to_params, of.to_coords, of.slack, of.project
    center = Coords(*cell_of(cell).center)
    tolerance = real(4.0 * _EPSILON[real])
    is_curve = DIMENSIONS[cell] == 1
    one, half = real(1.0), real(0.5)

    @wp.func
    def normal_step(arg: Arg, e: int, c: Coords, r: vector):
        """Gauss-Newton's step in parameters."""
        return inverse(arg, make_free_sample(e, c)) * r

    @wp.func
    def iterate(arg: Arg, e: int, x: vector):
        p = to_params(center)
        r = x - position(arg, make_free_sample(e, center))
        for _i in range(_STEPS):
            dp = normal_step(arg, e, to_coords(p), r)
            scale = one
            trial = x - position(arg, make_free_sample(e, to_coords(p + dp)))
            while scale > real(0.06) and not wp.dot(trial, trial) < wp.dot(r, r):
                scale *= half
                trial = x - position(arg, make_free_sample(e, to_coords(p + scale * dp)))
            p += scale * dp
            r = trial
            if not wp.max(wp.abs(dp)) > tolerance:
                break
        return to_coords(p)

    @wp.func
    def coordinates(arg: Arg, e: int, x: vector):
        c = wp.stop_gradient(iterate(arg, e, x))
        r = x - position(arg, make_free_sample(e, c))
        # The last step carries the derivative of the inverse map.
        return to_coords(to_params(c) + normal_step(arg, e, c, r))

    @wp.func
    def contains(arg: Arg, e: int, x: vector):
        c = coordinates(arg, e, x)
        s = make_free_sample(e, c)
        r = x - position(arg, s)
        size = one
        if wp.static(is_curve):
            F = gradient(arg, s)
            size = wp.dot(F, F)
        else:
            F = gradient(arg, s)
            size = wp.ddot(F, F)
        is_solved = wp.dot(r, r) <= tolerance * size
        return c, is_solved and slack(to_params(c)) >= -tolerance

    @wp.func
    def descent(arg: Arg, e: int, c: Coords, r: vector):
        """Gradient step in parameters, as long as the largest stretch allows."""
        F = gradient(arg, make_free_sample(e, c))
        if wp.static(is_curve):
            return wp.types.vector(1, real)(wp.dot(F, r)) / wp.dot(F, F)
        else:
            return (wp.transpose(F) * r) / wp.ddot(F, F)

    @wp.func
    def closest_point(arg: Arg, e: int, x: vector):
        c, is_inside = contains(arg, e, x)
        if is_inside:
            r = x - position(arg, make_free_sample(e, c))
            return c, wp.dot(r, r) * real(0.0)
        p = project(to_params(c))
        if not wp.dot(p, p) >= real(0.0):
            p = to_params(center)
        r = x - position(arg, make_free_sample(e, to_coords(p)))
        for _i in range(_PROJECTED_STEPS):
            before = p
            best = wp.dot(r, r)
            # Newton's step where it comes nearer, else a step down.
            q = project(p + normal_step(arg, e, to_coords(p), r))
            trial = x - position(arg, make_free_sample(e, to_coords(q)))
            if not wp.dot(trial, trial) < best:
                q = project(p + descent(arg, e, to_coords(p), r))
                trial = x - position(arg, make_free_sample(e, to_coords(q)))
            if wp.dot(trial, trial) < best:
                p = q
                r = trial
            if not wp.max(wp.abs(p - before)) > tolerance:
                break
        return to_coords(p), wp.dot(r, r)

    return coordinates, closest_point, contains
