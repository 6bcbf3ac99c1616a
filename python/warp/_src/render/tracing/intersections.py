"""Intersections of rays: triangles, spheres and level sets, nearest or any."""

import warp as wp
from warp._src.render.tracing.records import Hit, Instance, LevelSet, World
from warp._src.render.tracing.sampling import PI

FAR = wp.constant(1.0e30)
LEVEL_STEPS = wp.constant(256)


@wp.func
def box_span(origin: wp.vec3, dir: wp.vec3, low: wp.vec3, high: wp.vec3):
    """Distances at which a ray enters and leaves a box; the first is larger for a miss."""
    enter = float(0.0)
    leave = float(FAR)
    for k in range(3):
        if wp.abs(dir[k]) < 1.0e-12:
            if origin[k] < low[k] or origin[k] > high[k]:
                enter = FAR
                leave = 0.0
        else:
            a = (low[k] - origin[k]) / dir[k]
            b = (high[k] - origin[k]) / dir[k]
            enter = wp.max(enter, wp.min(a, b))
            leave = wp.min(leave, wp.max(a, b))
    return wp.vec2(enter, leave)


@wp.func
def sphere_distance(sphere: wp.vec4, origin: wp.vec3, dir: wp.vec3, nearest: float):
    """The first intersection beyond `nearest`, or FAR.

    E. Haines et al., Precision improvements for ray/sphere intersection, Ray Tracing Gems, 2019.
    """
    center = wp.vec3(sphere[0], sphere[1], sphere[2])
    radius = sphere[3]
    f = origin - center
    b = -wp.dot(f, dir)
    rest = f + b * dir
    d = radius * radius - wp.dot(rest, rest)
    found = float(FAR)
    if d >= 0.0:
        c = wp.dot(f, f) - radius * radius
        q = b + wp.where(b >= 0.0, 1.0, -1.0) * wp.sqrt(d)
        t0 = c / q
        t1 = q
        low = wp.min(t0, t1)
        high = wp.max(t0, t1)
        if low > nearest:
            found = low
        elif high > nearest:
            found = high
    return found


@wp.func
def level_distance(shape: LevelSet, origin: wp.vec3, dir: wp.vec3, most: float):
    """Sphere tracing to the zero of a level set, or FAR."""
    span = box_span(origin, dir, shape.low, shape.high)
    t = span[0]
    found = float(FAR)
    last = wp.min(span[1], most)
    step = int(0)
    while step < LEVEL_STEPS and t < last:
        d = wp.volume_sample_world(shape.volume, origin + t * dir, wp.Volume.LINEAR)
        if d < 0.02 * shape.reach:
            if t > 0.0:
                found = t
            step = LEVEL_STEPS
        t += wp.max(0.8 * wp.abs(d), 0.02 * shape.reach)
        step += 1
    return found


@wp.func
def level_normal(shape: LevelSet, x: wp.vec3):
    """The direction in which the distance grows most.

    Differences over two voxels are continuous; the gradient of the interpolation jumps
    between voxels.
    """
    uvw = wp.volume_world_to_index(shape.volume, x)
    along = wp.vec3()
    for axis in range(3):
        step = wp.vec3()
        step[axis] = 1.0
        ahead = wp.volume_sample_f(shape.volume, uvw + step, wp.Volume.LINEAR)
        along[axis] = ahead - wp.volume_sample_f(shape.volume, uvw - step, wp.Volume.LINEAR)
    return wp.normalize(wp.volume_index_to_world_dir(shape.volume, along))


@wp.func
def facing_side(n: wp.vec3, dir: wp.vec3):
    return wp.where(wp.dot(n, dir) > 0.0, -n, n)


@wp.func
def mesh_hit(world: World, place: Instance, hit: Hit, u: float, v: float, face: int):
    """Completes a hit of a triangle: shading normal, colour and texture coordinates."""
    shape = world.shapes[place.shape]
    w = 1.0 - u - v
    a = wp.mesh_get_index(shape.mesh, 3 * face)
    b = wp.mesh_get_index(shape.mesh, 3 * face + 1)
    c = wp.mesh_get_index(shape.mesh, 3 * face + 2)
    out = hit
    out.tint = place.tint
    if shape.normals >= 0:
        o = shape.normals
        n = u * world.normals[o + a] + v * world.normals[o + b] + w * world.normals[o + c]
        n = wp.normalize(wp.transpose(place.inverse) * n)
        out.normal = wp.where(wp.dot(n, hit.facing) < 0.0, -n, n)
    if shape.uvs >= 0:
        o = shape.uvs
        out.uv = u * world.uvs[o + a] + v * world.uvs[o + b] + w * world.uvs[o + c]
    if shape.colors >= 0:
        o = shape.colors
        tint = u * world.colors[o + a] + v * world.colors[o + b] + w * world.colors[o + c]
        out.tint = wp.cw_mul(out.tint, tint)
    return out


@wp.func
def nearest_sphere(world: World, origin: wp.vec3, dir: wp.vec3, most: float, least: float):
    """Distance and index of the nearest sphere, or -1."""
    t = float(most)
    found = int(-1)
    if world.sphere_count > 0:
        query = wp.bvh_query_ray(world.sphere_tree, origin, dir)
        index = int(0)
        while wp.bvh_query_next(query, index, t):
            d = sphere_distance(world.spheres[index], origin, dir, least)
            if d < t:
                t = d
                found = index
    return t, found


@wp.func
def nearest_hit(world: World, origin: wp.vec3, dir: wp.vec3, most: float, least: float):
    """The nearest surface along a ray."""
    hit = Hit()
    hit.material = -1
    hit.lamp = -1
    t, sphere = nearest_sphere(world, origin, dir, most, least)
    if sphere >= 0:
        s = world.spheres[sphere]
        n = wp.normalize(origin + t * dir - wp.vec3(s[0], s[1], s[2]))
        hit.normal = n
        hit.tint = world.sphere_colors[sphere]
        hit.material = world.sphere_materials[sphere]
        hit.lamp = sphere
        turn = 0.5 + wp.atan2(wp.dot(n, world.north), wp.dot(n, world.east)) / (2.0 * PI)
        hit.uv = wp.vec2(turn, wp.acos(wp.clamp(wp.dot(n, world.up), -1.0, 1.0)) / PI)
        hit.facing = facing_side(n, dir)
        hit.normal = hit.facing
    if world.instance_count > 0:
        best = int(-1)
        face = int(0)
        bary = wp.vec2()
        normal = wp.vec3()
        query = wp.bvh_query_ray(world.instance_tree, origin, dir)
        index = int(0)
        while wp.bvh_query_next(query, index, t):
            place = world.instances[index]
            o = place.inverse * (origin - place.origin)
            d = place.inverse * dir
            stretch = wp.length(d)
            found = wp.mesh_query_ray(world.shapes[place.shape].mesh, o, d / stretch, t * stretch)
            if found.result and found.t / stretch < t and found.t / stretch > least:
                t = found.t / stretch
                best = index
                face = found.face
                bary = wp.vec2(found.u, found.v)
                normal = found.normal
        if best >= 0:
            place = world.instances[best]
            hit.material = place.material
            hit.lamp = -1
            n = wp.normalize(wp.transpose(place.inverse) * normal)
            hit.facing = facing_side(n, dir)
            hit.normal = hit.facing
            p = origin + t * dir
            hit.uv = wp.vec2(wp.dot(p, world.east), wp.dot(p, world.north))
            hit = mesh_hit(world, place, hit, bary[0], bary[1], face)
    for k in range(world.level_set_count):
        shape = world.level_sets[k]
        d = level_distance(shape, origin, dir, t)
        if d < t and d > least:
            t = d
            hit.material = shape.material
            hit.lamp = -1
            hit.tint = shape.tint
            hit.facing = facing_side(level_normal(shape, origin + t * dir), dir)
            hit.normal = hit.facing
    hit.t = t
    return hit


@wp.func
def is_blocked(world: World, origin: wp.vec3, dir: wp.vec3, most: float, least: float):
    """True if a surface lies between."""
    blocked = bool(False)
    if world.sphere_count > 0:
        query = wp.bvh_query_ray(world.sphere_tree, origin, dir)
        index = int(0)
        while not blocked and wp.bvh_query_next(query, index, most):
            blocked = sphere_distance(world.spheres[index], origin, dir, least) < most
    if world.instance_count > 0 and not blocked:
        query = wp.bvh_query_ray(world.instance_tree, origin, dir)
        index = int(0)
        while not blocked and wp.bvh_query_next(query, index, most):
            place = world.instances[index]
            o = place.inverse * (origin - place.origin)
            d = place.inverse * dir
            stretch = wp.length(d)
            mesh = world.shapes[place.shape].mesh
            blocked = wp.mesh_query_ray_anyhit(mesh, o, d / stretch, most * stretch)
    for k in range(world.level_set_count):
        if not blocked:
            blocked = level_distance(world.level_sets[k], origin, dir, most) < most
    return blocked
