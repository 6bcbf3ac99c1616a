"""A buoy on an ocean at sunset: trains of waves as deep water carries them, seen to the horizon.

    python examples/scenes/ocean_sunset.py [--device cpu] [--frames 24] [--samples 8]

The error is that of the heights against the same sums by NumPy in double precision.
"""

import numpy as np
from movies import Movie, revolved

import warp as wp

# [m/s^2], [m/s], [s]
GRAVITY, WIND, PERIOD = 9.81, 7.0, 6.0


@wp.struct
class Wave:
    """One train of waves: wave vector [1/m], amplitude [m], frequency [1/s], phase."""

    k: wp.vec2
    amplitude: float
    frequency: float
    phase: float


@wp.kernel
def surface(
    waves: wp.array[Wave],
    at: wp.array[wp.vec2],
    spacing: wp.array[float],
    t: float,
    points: wp.array[wp.vec3],
    slopes: wp.array[wp.vec2],
):
    """Points of the water above places, without the waves that the grid is too coarse for."""
    i = wp.tid()
    x = at[i]
    h = float(0.0)
    s = wp.vec2()
    for n in range(waves.shape[0]):
        w = waves[n]
        seen = wp.clamp(2.0 - 0.5 * wp.length(w.k) * spacing[i], 0.0, 1.0)
        angle = wp.dot(w.k, x) + w.phase - w.frequency * t
        h += seen * w.amplitude * wp.cos(angle)
        s -= w.k * (seen * w.amplitude * wp.sin(angle))
    points[i] = wp.vec3(x[0], h, x[1])
    slopes[i] = s


def spectrum(count):
    """Waves of Phillips's spectrum; frequencies repeat after the film's period."""
    rng = np.random.default_rng(7)
    length = np.geomspace(0.12, 15.0, count)
    k = 2.0 * np.pi / length
    way = 1.1 + rng.normal(0.0, 0.55, count)
    energy = np.exp(-1.0 / (k * WIND * WIND / GRAVITY) ** 2) / k**2.6
    amplitude = 0.24 * np.sqrt(energy / energy.sum()) * rng.rayleigh(1.0, count)
    step = 2.0 * np.pi / PERIOD
    frequency = np.rint(np.sqrt(GRAVITY * k) / step) * step
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    vectors = k * [np.cos(way), np.sin(way)]
    rows = [(tuple(one), *rest) for one, *rest in zip(vectors.T, amplitude, frequency, phase)]
    numbers = [(name, np.float32) for name in ("amplitude", "frequency", "phase")]
    return np.array(rows, dtype=[("k", np.float32, 2), *numbers])


def fan(size):
    """A grid that widens with the distance from the eye, its spacing, and its faces."""
    turn = np.linspace(-0.75, 0.75, size)
    far = np.geomspace(2.5, 6000.0, size)
    far, turn = np.meshgrid(far, turn, indexing="ij")
    at = np.stack([far * np.sin(turn), 12.0 - far * np.cos(turn)], axis=-1).reshape(-1, 2)
    spacing = far * max(1.5 / size, np.log(2400.0) / size)
    a = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).reshape(-1)
    faces = np.stack([a, a + 1, a + size + 1, a, a + size + 1, a + size], axis=1)
    return at, spacing.reshape(-1), faces.reshape(-1)


def exact(rows, at, spacing, t):
    """Heights in double precision, with the numbers that the kernel has."""
    k = rows["k"].astype(float)
    seen = np.clip(2.0 - 0.5 * np.linalg.norm(k, axis=1) * spacing[:, None], 0.0, 1.0)
    angle = at @ k.T + rows["phase"].astype(float) - rows["frequency"].astype(float) * t
    return (seen * rows["amplitude"].astype(float) * np.cos(angle)).sum(axis=1)


def add_buoy(scene):
    """A red buoy with a white band and a lamp."""
    body = [(0, -0.5), (0.5, -0.45), (0.62, 0.0), (0.6, 0.25), (0.3, 0.42), (0.27, 0.95)]
    parts = [
        (body, {"color": (0.75, 0.05, 0.03), "roughness": 0.25}),
        ([(0.265, 0.95), (0.24, 1.3)], {"color": (0.9, 0.9, 0.85), "roughness": 0.3}),
        ([(0.24, 1.3), (0.2, 1.75), (0, 1.75)], {"color": (0.75, 0.05, 0.03), "roughness": 0.25}),
    ]
    made = [scene.add_mesh(*revolved(profile), **material) for profile, material in parts]
    lamp = scene.add_spheres([[0, 1.9, 0]], 0.13, emission=(60, 42, 16))
    return made, lamp


def main():
    movie = Movie("ocean_sunset", __doc__, frames=30, samples=6, fps=10.0)
    scene, device = movie.scene, movie.device
    size = movie.count(700)
    at, spacing, faces = fan(size)
    rows = spectrum(160)
    waves = wp.array(rows, dtype=Wave, device=device)
    # The buoy is one more place.
    at, spacing = np.vstack([at, [[1.4, 2.0]]]), np.append(spacing, 0.4)
    places = wp.array(at, dtype=wp.vec2, device=device)
    gaps = wp.array(spacing, dtype=float, device=device)
    points = wp.zeros(len(at), dtype=wp.vec3, device=device)
    slopes = wp.zeros(len(at), dtype=wp.vec2, device=device)
    scene.set_sky(sun=(-0.2, 0.07, -1.0), power=16.0, haze=2.2, size=0.9, ground=(0.1, 0.1, 0.1))
    scene.exposure = 1.4
    scene.set_camera((0.0, 2.1, 11.0), (0.15, 1.45, 0.0), fov=31.0)

    def advance(t):
        inputs = [waves, places, gaps, t]
        wp.launch(surface, len(at), inputs, [points, slopes], device=device)

    movie.timed(lambda: advance(0.0))
    water = scene.add_mesh(
        points.numpy()[:-1], faces, color=(0.01, 0.05, 0.065), specular=0.02, roughness=0.16
    )
    buoy, lamp = add_buoy(scene)
    movie.work, worst = 0.0, 0.0
    for frame in range(movie.frames):
        t = PERIOD * frame / movie.frames
        movie.timed(lambda t=t: advance(t))
        rise = points.numpy()
        some = np.random.default_rng(frame).integers(0, len(at), 2000)
        off = rise[some, 1] - exact(
            rows, at[some].astype(np.float32).astype(float), spacing[some], t
        )
        worst = max(worst, float(np.abs(off[np.hypot(*at[some].T) < 100.0]).max()))
        water.mesh.update(rise[:-1])
        x, y, z = rise[-1]
        a, b = 0.7 * slopes.numpy()[-1]
        up = np.array([-a, 1.0, -b]) / np.sqrt(1.0 + a * a + b * b)
        side = np.cross(up, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side)
        place = np.eye(4)
        place[:3, 0], place[:3, 1], place[:3, 2] = side, up, np.cross(side, up)
        place[:3, 3] = (x, y - 0.1, z)
        for part in buoy:
            part.update(place)
        lamp.update((place[:3, 3] + 1.9 * up)[None])
        movie.add()
    rate = 1e3 * movie.work / movie.frames
    movie.finish(rate, "ms a frame of waves", worst, "error of heights, m")


if __name__ == "__main__":
    main()
