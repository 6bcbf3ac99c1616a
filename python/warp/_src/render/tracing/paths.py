"""Path tracing: one sample of each pixel, with light sampling weighted by the balance heuristic.

E. Veach, Robust Monte Carlo methods for light transport simulation, 1997, sections 9.2 and 10.
"""

import warp as wp
from warp._src.render.tracing.intersections import FAR, nearest_hit
from warp._src.render.tracing.light import (
    choose_light,
    in_sun,
    lamp_density,
    light_count,
    reaching,
    sky_radiance,
    sun_density,
    texture_color,
)
from warp._src.render.tracing.media import collision
from warp._src.render.tracing.records import Camera, Film, Hit, Path, World
from warp._src.render.tracing.sampling import (
    basis,
    luminance,
    phase_density,
    phase_direction,
    rotated,
)
from warp._src.render.tracing.scattering import (
    dielectric,
    scatter,
    scatter_density,
    scatter_value,
)

ROULETTE = wp.constant(3)


@wp.func
def gathered(path: Path, light: wp.vec3, limit: float):
    """Adds light that reaches the eye; after the first bounce a sample counts up to the limit."""
    out = path
    add = wp.cw_mul(path.throughput, light)
    bright = luminance(add)
    if path.bounce > 0 and bright > limit:
        add = add * (limit / bright)
    out.color = path.color + add
    return out


@wp.func
def weight(own: float, other: float):
    """The balance heuristic; a path that could not have been sampled otherwise counts whole."""
    return wp.where(own >= 0.0, own / wp.max(own + other, 1.0e-20), 1.0)


@wp.func
def escaped(world: World, path: Path, limit: float):
    """A path that leaves into the sky."""
    light = sky_radiance(world, path.dir)
    if in_sun(world, path.dir):
        light += world.sun_radiance * weight(path.density, sun_density(world))
    out = gathered(path, light, limit)
    if path.bounce == 0:
        out.albedo = wp.vec3(1.0)
        out.normal = wp.vec4(0.0, 0.0, 0.0, FAR)
    out.alive = 0
    return out


@wp.func
def color_of(world: World, hit: Hit):
    """The base colour where a ray hits."""
    m = world.materials[hit.material]
    color = wp.cw_mul(m.color, hit.tint)
    if m.texture >= 0:
        color = wp.cw_mul(color, texture_color(world, m.texture, hit.uv))
    if m.checker > 0.0:
        cell = int(wp.floor(hit.uv[0] / m.checker)) + int(wp.floor(hit.uv[1] / m.checker))
        if (cell & 1) == 1:
            color = 0.45 * color
    return color


@wp.func
def through_glass(world: World, path: Path, hit: Hit, color: wp.vec3, x: wp.vec3, choice: float):
    """Reflects or refracts at a smooth dielectric."""
    m = world.materials[hit.material]
    out = path
    leaving = path.inside == hit.material
    eta = wp.where(leaving, 1.0 / m.ior, m.ior)
    cosine = wp.clamp(-wp.dot(path.dir, hit.normal), 0.0, 1.0)
    side = 1.0
    if choice < dielectric(eta, cosine):
        out.dir = path.dir + 2.0 * cosine * hit.normal
    else:
        inner = wp.sqrt(wp.max(0.0, 1.0 - (1.0 - cosine * cosine) / (eta * eta)))
        out.dir = wp.normalize(path.dir / eta + (cosine / eta - inner) * hit.normal)
        out.inside = wp.where(leaving, -1, hit.material)
        out.throughput = wp.cw_mul(path.throughput, color)
        side = -1.0
    out.origin = x + hit.facing * (side * world.reach)
    out.density = -1.0
    return out


@wp.func
def at_surface(world: World, path: Path, hit: Hit, limit: float, seed: int, uv: wp.vec4):
    """Emission, light sampling and the next direction at a surface."""
    state = wp.rand_init(seed)
    m = world.materials[hit.material]
    x = path.origin + hit.t * path.dir
    color = color_of(world, hit)
    out = path
    if luminance(m.emission) > 0.0:
        share = float(1.0)
        if hit.lamp >= 0:
            share = weight(path.density, lamp_density(world, hit.lamp, path.origin))
        out = gathered(out, m.emission * share, limit)
    if path.bounce == 0:
        out.albedo = wp.where(luminance(m.emission) > 0.0, wp.vec3(1.0), color)
        n = hit.normal
        out.normal = wp.vec4(n[0], n[1], n[2], hit.t)
    if wp.randf(state) < m.transmission:
        out = through_glass(world, out, hit, color, x, wp.randf(state))
    else:
        frame = basis(hit.normal)
        wo = wp.transpose(frame) * (-path.dir)
        # A shading normal may face away from the eye.
        wo = wp.normalize(wp.vec3(wo[0], wo[1], wp.max(wo[2], 1.0e-3)))
        start = x + hit.facing * world.reach
        if light_count(world) > 0:
            light = choose_light(world, start, wp.randf(state), uv[2], uv[3])
            wi = wp.transpose(frame) * light.dir
            value = scatter_value(m, color, wo, wi)
            faces = wp.dot(light.dir, hit.facing) > 0.0
            if light.density > 0.0 and faces and luminance(value) > 0.0:
                share = weight(light.density, scatter_density(m, color, wo, wi))
                share *= reaching(world, start, light.dir, light.distance, 0.0, wp.randi(state))
                sent = wp.cw_mul(value, light.radiance) * (share / light.density)
                out = gathered(out, sent, limit)
        wi = scatter(m, color, wo, wp.randf(state), uv[0], uv[1])
        density = scatter_density(m, color, wo, wi)
        out.dir = wp.normalize(frame * wi)
        out.origin = start
        out.density = wp.where(light_count(world) > 0, density, -1.0)
        if density > 0.0 and wp.dot(out.dir, hit.facing) > 0.0:
            value = scatter_value(m, color, wo, wi) / density
            out.throughput = wp.cw_mul(out.throughput, value)
        else:
            out.alive = 0
    return out


@wp.func
def in_medium(world: World, path: Path, number: int, t: float, limit: float, seed: int):
    """Emission, light sampling and the next direction at a collision in a medium."""
    state = wp.rand_init(seed)
    medium = world.media[number]
    out = gathered(path, medium.emission, limit)
    x = path.origin + t * path.dir
    out.throughput = wp.cw_mul(path.throughput, medium.albedo)
    if light_count(world) > 0:
        light = choose_light(world, x, wp.randf(state), wp.randf(state), wp.randf(state))
        if light.density > 0.0:
            value = phase_density(medium.asymmetry, wp.dot(path.dir, light.dir))
            share = weight(light.density, value)
            share *= reaching(world, x, light.dir, light.distance, 0.0, wp.randi(state))
            sent = light.radiance * (value * share / light.density)
            out = gathered(out, sent, limit)
    local = phase_direction(medium.asymmetry, wp.randf(state), wp.randf(state))
    out.dir = wp.normalize(basis(path.dir) * local)
    density = phase_density(medium.asymmetry, wp.dot(path.dir, out.dir))
    out.density = wp.where(light_count(world) > 0, density, -1.0)
    out.origin = x
    return out


@wp.func
def advanced(world: World, path: Path, limit: float, seed: int, uv: wp.vec4):
    """Follows a path to its next scattering event."""
    state = wp.rand_init(seed)
    hit = nearest_hit(world, path.origin, path.dir, FAR, world.reach)
    t = hit.t
    medium = int(-1)
    for k in range(world.medium_count):
        d = collision(world.media[k], path.origin, path.dir, t, wp.randi(state))
        if d < t:
            t = d
            medium = k
    out = path
    if path.inside >= 0 and t < FAR:
        a = world.materials[path.inside].absorption * t
        dim = wp.vec3(wp.exp(-a[0]), wp.exp(-a[1]), wp.exp(-a[2]))
        out.throughput = wp.cw_mul(path.throughput, dim)
    if medium >= 0:
        out = in_medium(world, out, medium, t, limit, wp.randi(state))
        if path.bounce == 0:
            # The surface behind guides the filter: collisions are noise themselves.
            out.albedo = wp.vec3(1.0)
            out.normal = wp.vec4(0.0, 0.0, 0.0, FAR)
            if hit.material >= 0:
                out.albedo = color_of(world, hit)
                n = hit.normal
                out.normal = wp.vec4(n[0], n[1], n[2], hit.t)
    elif hit.material < 0:
        out = escaped(world, out, limit)
    else:
        out = at_surface(world, out, hit, limit, wp.randi(state), uv)
    if out.alive == 1 and path.bounce >= ROULETTE:
        survive = wp.min(1.0, wp.max(out.throughput))
        if wp.randf(state) < survive:
            out.throughput = out.throughput / survive
        else:
            out.alive = 0
    out.bounce = path.bounce + 1
    return out


@wp.func
def camera_path(camera: Camera, x: float, y: float, u: float, v: float):
    """A path that leaves the lens through a point of the film, x and y from -1 to 1."""
    path = Path()
    out = camera.right * (x * camera.tangent) + camera.up * (y * camera.tangent)
    dir = out + camera.forward
    r = camera.aperture * wp.sqrt(u)
    phi = 6.28318530718 * v
    lens = camera.right * (r * wp.cos(phi)) + camera.up * (r * wp.sin(phi))
    path.origin = camera.eye + lens
    path.dir = wp.normalize(dir * camera.focus - lens)
    path.throughput = wp.vec3(1.0)
    path.density = -1.0
    path.inside = -1
    path.alive = 1
    return path


@wp.kernel(enable_backward=False)
def trace(
    world: World,
    camera: Camera,
    film: Film,
    before: int,
    samples: int,
    depth: int,
    limit: float,
    seed: int,
):
    """Adds samples to every pixel."""
    i, j = wp.tid()
    height = film.color.shape[0]
    width = film.color.shape[1]
    pixel = i * width + j
    turns = wp.rand_init(seed, pixel)
    turn = wp.vector(dtype=wp.uint32, length=6)
    for k in range(6):
        turn[k] = wp.randu(turns)
    for n in range(samples):
        step = wp.uint32(before + n)
        x = (2.0 * (float(j) + rotated(step, 0, turn[0])) - float(width)) / float(height)
        y = (float(height) - 2.0 * (float(i) + rotated(step, 1, turn[1]))) / float(height)
        state = wp.rand_init(seed + 7919 * (before + n + 1), pixel)
        path = camera_path(camera, x, y, wp.randf(state), wp.randf(state))
        uv = wp.vec4(
            rotated(step, 2, turn[2]),
            rotated(step, 3, turn[3]),
            rotated(step, 4, turn[4]),
            rotated(step, 5, turn[5]),
        )
        while path.alive == 1 and path.bounce <= depth:
            path = advanced(world, path, limit, wp.randi(state), uv)
            uv = wp.vec4(wp.randf(state), wp.randf(state), wp.randf(state), wp.randf(state))
        bright = luminance(path.color)
        if wp.isfinite(bright):
            film.color[i, j] += path.color
            film.square[i, j] += bright * bright
        else:
            wp.atomic_add(film.rejected, 0, 1)
        film.albedo[i, j] += path.albedo
        film.normal[i, j] += wp.vec4(
            path.normal[0], path.normal[1], path.normal[2], wp.min(path.normal[3], 1.0e4)
        )
