"""Rocks of a NanoVDB file in drifting dust: a level set and a medium, both sparse volumes.

    python examples/scenes/dusty_rocks.py [--device cpu] [--frames 1] [--samples 32]

The distances of eroded rocks are computed by a kernel, saved, and loaded again. The error is how
far the places where rays cross zero in the file's volume are from the surface of the formula,
which the file only samples: its value there over its slope, in voxels. Rays are bisected, so that
the error is that of the samples and of the interpolation between them.
"""

import time

import numpy as np
from movies import Movie

import warp as wp

ROUGH = 0.1
LOW, HIGH = (-2.2, -0.25, -1.7), (2.2, 1.35, 2.3)


@wp.func
def ridges(x: wp.vec3, seed: wp.uint32):
    """Noise in five octaves, folded to ridges."""
    total = float(0.0)
    size = float(0.5)
    p = x
    for _ in range(5):
        total += size * (1.0 - 2.0 * wp.abs(wp.noise(seed, p)))
        p = 2.03 * p + wp.vec3(1.7, 9.2, 4.1)
        size *= 0.5
    return total


@wp.func
def distance(places: wp.array[wp.vec4], x: wp.vec3, rough: float):
    """Signed distance of boulders and of the ground between them, eroded by noise."""
    d = float(10.0)
    for n in range(places.shape[0]):
        s = places[n]
        away = x - wp.vec3(s[0], s[1], s[2])
        # Flattened and broken by planes.
        y = wp.vec3(away[0], 1.35 * away[1], away[2])
        ball = 0.8 * (wp.length(y) - s[3])
        slant = away[0] * wp.cos(3.0 * float(n)) + away[2] * wp.sin(3.0 * float(n))
        d = wp.min(d, wp.max(ball, 0.9 * (slant - 0.62 * s[3])))
    ground = x[1] - 0.06 * wp.noise(wp.uint32(5), 1.1 * x)
    mix = wp.clamp(0.5 + 0.5 * (ground - d) / 0.12, 0.0, 1.0)
    d = ground * (1.0 - mix) + d * mix - 0.12 * mix * (1.0 - mix)
    return 0.6 * (d - rough * ridges(2.6 * x, wp.uint32(11)))


@wp.kernel
def carve(
    places: wp.array[wp.vec4], low: wp.vec3, voxel: float, rough: float, out: wp.array3d[float]
):
    """The distance at the middle of each voxel."""
    i, j, k = wp.tid()
    out[i, j, k] = distance(places, low + voxel * wp.vec3(float(i), float(j), float(k)), rough)


@wp.kernel
def raise_dust(low: wp.vec3, cell: float, t: float, out: wp.array3d[float]):
    """Dust that lies low and drifts."""
    i, j, k = wp.tid()
    x = low + cell * wp.vec3(float(i), float(j), float(k))
    drift = wp.vec3(x[0] - 0.35 * t, x[1] + 0.05 * t, x[2])
    swirl = wp.noise(wp.uint32(3), 0.9 * drift)
    clouds = ridges(1.3 * drift + wp.vec3(swirl, 0.0, swirl), wp.uint32(21))
    layer = wp.exp(-3.4 * wp.max(x[1] - 0.05, 0.0))
    out[i, j, k] = wp.max(0.0, (clouds - 0.12) * layer)


@wp.kernel
def look(
    id: wp.uint64,
    start: wp.array[wp.vec3],
    dir: wp.array[wp.vec3],
    reach: float,
    stops: wp.array[wp.vec3],
    found: wp.array[int],
):
    """The places where rays find the surface of a volume."""
    n = wp.tid()
    t = float(0.0)
    step = float(0.0)
    for _ in range(400):
        d = wp.volume_sample_world(id, start[n] + t * dir[n], wp.Volume.LINEAR)
        if d < 0.0:
            found[n] = 1
            break
        step = wp.max(0.8 * d, 0.02 * reach)
        t += step
        if t > 6.0:
            break
    # Halves the last step down to a thousandth of a voxel.
    t -= step
    for _ in range(14):
        step *= 0.5
        if wp.volume_sample_world(id, start[n] + (t + step) * dir[n], wp.Volume.LINEAR) >= 0.0:
            t += step
    stops[n] = start[n] + t * dir[n]


@wp.kernel
def judge(places: wp.array[wp.vec4], stops: wp.array[wp.vec3], rough: float, out: wp.array[float]):
    """How far places are from the surface of the formula: its value over its slope."""
    n = wp.tid()
    x = stops[n]
    step = 0.002
    slope = wp.vec3()
    for axis in range(3):
        shift = wp.vec3()
        shift[axis] = step
        ends = distance(places, x + shift, rough) - distance(places, x - shift, rough)
        slope[axis] = ends / (2.0 * step)
    out[n] = wp.abs(distance(places, x, rough)) / wp.length(slope)


def surface_error(volume, voxel, places, device, count=4000):
    """Distances from the formula's surface where rays from above stop, over a voxel: 95 % of them.

    The others are at creases, which a grid rounds.
    """
    rng = np.random.default_rng(2)
    start = rng.uniform((-1.8, 1.25, -1.3), (1.8, 1.3, 1.0), (count, 3))
    down = rng.normal(0.0, 0.2, (count, 3)) - [0, 1, 0]
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    rays = [wp.array(values, dtype=wp.vec3, device=device) for values in (start, down)]
    stops = wp.zeros(count, dtype=wp.vec3, device=device)
    found = wp.zeros(count, dtype=int, device=device)
    away = wp.zeros(count, dtype=float, device=device)
    wp.launch(look, count, [volume.id, *rays, voxel], [stops, found], device=device)
    wp.launch(judge, count, [places, stops, ROUGH], [away], device=device)
    return np.quantile(away.numpy()[found.numpy() == 1], 0.95) / voxel


def main():
    movie = Movie("dusty_rocks", __doc__, frames=1, samples=32)
    scene, device = movie.scene, movie.device
    rng = np.random.default_rng(9)
    places = np.column_stack(
        [rng.uniform(-1.7, 1.7, 16), rng.uniform(-0.1, 0.15, 16), rng.uniform(-1.5, 0.6, 16)]
    )
    sizes = rng.uniform(0.14, 0.34, 16)
    places = np.vstack([np.column_stack([places, sizes]), [[-0.55, 0.2, -0.35, 0.62]]])
    boulders = wp.array(places, dtype=wp.vec4, device=device)
    voxel = 0.016 / movie.options.scale ** (1 / 3)
    shape = tuple(int((b - a) / voxel) + 1 for a, b in zip(LOW, HIGH))
    field = wp.zeros(shape, dtype=float, device=device)
    begin = time.perf_counter()
    wp.launch(carve, shape, [boulders, wp.vec3(*LOW), voxel, ROUGH], [field], device=device)
    values = field.numpy()
    rate = values.size / (time.perf_counter() - begin) / 1e6
    options = {"min_world": LOW, "voxel_size": voxel, "device": device}
    rocks = wp.Volume.load_from_numpy(values, bg_value=0.5, **options)
    movie.options.output.mkdir(parents=True, exist_ok=True)
    path = rocks.save_to_nvdb(movie.options.output / "dusty_rocks.nvdb", codec="zip")
    rocks = wp.Volume.load_from_nvdb(path, device=device)
    stone = {"color": (0.42, 0.3, 0.21), "roughness": 0.85, "specular": 0.02}
    scene.add_level_set(rocks, **stone)
    cell = 0.05
    size = tuple(int((b - a) / cell) + 1 for a, b in zip(LOW, HIGH))
    dust = wp.zeros(size, dtype=float, device=device)

    def clouds(t):
        wp.launch(raise_dust, size, [wp.vec3(*LOW), cell, t], [dust], device=device)
        where = {"min_world": LOW, "voxel_size": cell, "device": device}
        return wp.Volume.load_from_numpy(dust.numpy(), bg_value=0.0, **where)

    air = {"albedo": (0.95, 0.82, 0.66), "asymmetry": 0.55}
    medium = scene.add_volume(clouds(0.0), 0.8, **air)
    sand = {"color": (0.42, 0.3, 0.21), "roughness": 0.9, "specular": 0.02}
    scene.add_height_field(np.full((2, 2), -0.08), (-80, -80), (80, 80), **sand)
    scene.set_sky(sun=(0.9, 0.34, 0.05), power=9.0, size=1.5, haze=2.0, ground=(0.6, 0.5, 0.4))
    scene.set_camera((0.6, 0.62, 2.9), (-0.1, 0.3, -0.3), fov=34.0, aperture=0.012, focus=3.1)
    scene.depth = 5
    for frame in range(movie.frames):
        if frame:
            scene.replace_volume(medium, clouds(frame / 15.0))
        movie.add()
    movie.finish(
        rate,
        "M voxels a second",
        surface_error(rocks, voxel, boulders, device),
        "off the surface, voxels",
    )


if __name__ == "__main__":
    main()
