"""Light that arrives: the sky's table, the sun, and spheres that shine."""

import warp as wp
from warp._src.render.tracing.intersections import FAR, is_blocked, sphere_distance
from warp._src.render.tracing.media import transmittance
from warp._src.render.tracing.records import Image, Light, World
from warp._src.render.tracing.sampling import PI, basis, cone_density, cone_direction


@wp.func
def sky_radiance(world: World, dir: wp.vec3):
    """The sky without the sun, bilinear in a table over azimuth and height."""
    rows = world.sky.shape[0]
    columns = world.sky.shape[1]
    height = wp.acos(wp.clamp(wp.dot(dir, world.up), -1.0, 1.0)) / PI
    turn = wp.atan2(wp.dot(dir, world.north), wp.dot(dir, world.east)) / (2.0 * PI) + 0.5
    y = wp.clamp(height * float(rows) - 0.5, 0.0, float(rows - 1))
    x = turn * float(columns) - 0.5
    x = x - wp.floor(x / float(columns)) * float(columns)
    i0 = int(y)
    j0 = wp.min(int(x), columns - 1)
    i1 = wp.min(i0 + 1, rows - 1)
    j1 = wp.where(j0 + 1 == columns, 0, j0 + 1)
    fy = y - float(i0)
    fx = x - float(j0)
    above = world.sky[i0, j0] * (1.0 - fx) + world.sky[i0, j1] * fx
    below = world.sky[i1, j0] * (1.0 - fx) + world.sky[i1, j1] * fx
    return above * (1.0 - fy) + below * fy


@wp.func
def in_sun(world: World, dir: wp.vec3):
    return world.sun_cosine < 1.0 and wp.dot(dir, world.sun) >= world.sun_cosine


@wp.func
def texel(world: World, image: Image, i: int, j: int):
    row = ((i % image.height) + image.height) % image.height
    column = ((j % image.width) + image.width) % image.width
    return world.texels[image.start + row * image.width + column]


@wp.func
def texture_color(world: World, number: int, uv: wp.vec2):
    """A texture, bilinear and repeated."""
    image = world.images[number]
    x = uv[0] * float(image.width) - 0.5
    y = (1.0 - uv[1]) * float(image.height) - 0.5
    j = int(wp.floor(x))
    i = int(wp.floor(y))
    fx = x - wp.floor(x)
    fy = y - wp.floor(y)
    above = texel(world, image, i, j) * (1.0 - fx) + texel(world, image, i, j + 1) * fx
    below = texel(world, image, i + 1, j) * (1.0 - fx) + texel(world, image, i + 1, j + 1) * fx
    return above * (1.0 - fy) + below * fy


@wp.func
def lamp_cosine(world: World, lamp: int, x: wp.vec3):
    """Cosine of the half angle of a shining sphere seen from x; 1 from inside."""
    s = world.spheres[lamp]
    away = wp.vec3(s[0], s[1], s[2]) - x
    d2 = wp.dot(away, away)
    r2 = s[3] * s[3]
    return wp.where(d2 > r2, wp.sqrt(wp.max(0.0, 1.0 - r2 / wp.max(d2, 1.0e-20))), 1.0)


@wp.func
def light_count(world: World):
    return world.lamp_count + wp.where(world.sun_cosine < 1.0, 1, 0)


@wp.func
def lamp_density(world: World, lamp: int, x: wp.vec3):
    """The density over directions of choosing this sphere and a direction to it."""
    return cone_density(lamp_cosine(world, lamp, x)) / float(light_count(world))


@wp.func
def sun_density(world: World):
    return cone_density(world.sun_cosine) / float(light_count(world))


@wp.func
def reaching(world: World, x: wp.vec3, dir: wp.vec3, most: float, least: float, seed: int):
    """The share of light that gets from there to x."""
    share = float(0.0)
    if not is_blocked(world, x, dir, most, least):
        share = transmittance(world, x, dir, most, seed)
    return share


@wp.func
def choose_light(world: World, x: wp.vec3, choice: float, u: float, v: float):
    """A direction to a light, its radiance over the density, the density and the distance."""
    light = Light()
    number = wp.min(int(choice * float(light_count(world))), light_count(world) - 1)
    if number < world.lamp_count:
        lamp = world.lamps[number]
        s = world.spheres[lamp]
        away = wp.vec3(s[0], s[1], s[2]) - x
        cosine = lamp_cosine(world, lamp, x)
        if cosine < 1.0:
            light.dir = basis(wp.normalize(away)) * cone_direction(cosine, u, v)
            light.distance = sphere_distance(s, x, light.dir, 0.0)
            light.density = lamp_density(world, lamp, x)
            light.radiance = world.materials[world.sphere_materials[lamp]].emission
            if light.distance >= FAR:
                # Rounding put the direction past the limb.
                light.distance = wp.length(away)
            light.distance *= 0.9999
    else:
        light.dir = basis(world.sun) * cone_direction(world.sun_cosine, u, v)
        light.distance = float(FAR)
        light.density = sun_density(world)
        light.radiance = world.sun_radiance
    return light
