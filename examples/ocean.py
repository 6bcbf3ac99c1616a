"""An ocean: a height field of waves that travel as deep water lets them, and its shaded picture.

    python examples/ocean.py [--device cpu] [--size 256] [--waves 96] [--frames 20]

Each point adds up Gerstner's waves, a circle of water for each. The last line of the table has the
largest error of heights and slopes against the same sums by NumPy in double precision.
"""

import argparse
import time
from pathlib import Path
from typing import Any, cast

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# [m/s^2], [m], [m/s]
GRAVITY, EDGE, WIND = 9.81, 60.0, 6.0


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
    spacing: float,
    t: float,
    height: wp.array2d[float],
    slope: wp.array2d[wp.vec2],
):
    """Height [m] of the water and its slope at the points of a grid."""
    i, j = wp.tid()
    x = wp.vec2(float(i) * spacing, float(j) * spacing)
    h = float(0.0)
    s = wp.vec2()
    for n in range(waves.shape[0]):
        w = waves[n]
        angle = wp.dot(w.k, x) + w.phase - w.frequency * t
        h += w.amplitude * wp.cos(angle)
        s -= w.k * (w.amplitude * wp.sin(angle))
    height[i, j] = h
    slope[i, j] = s


@wp.kernel
def shade(slope: wp.array2d[wp.vec2], light: wp.vec3, color: wp.array2d[wp.vec3]):
    """Sky that the water mirrors, by Schlick's formula, and the light of a low sun."""
    i, j = wp.tid()
    normal = wp.normalize(wp.vec3(-slope[i, j][0], -slope[i, j][1], 1.0))
    eye = wp.normalize(wp.vec3(0.0, -1.0, 0.7))
    mirrored = 2.0 * wp.dot(normal, eye) * normal - eye
    fresnel = 0.02 + 0.98 * wp.pow(1.0 - wp.clamp(wp.dot(normal, eye), 0.0, 1.0), 5.0)
    sky = wp.lerp(wp.vec3(0.75, 0.83, 0.9), wp.vec3(0.2, 0.4, 0.7), wp.clamp(mirrored[2], 0.0, 1.0))
    glint = wp.pow(wp.clamp(wp.dot(mirrored, light), 0.0, 1.0), 250.0)
    water = wp.vec3(0.02, 0.16, 0.22)
    color[i, j] = wp.lerp(water, sky, fresnel) + glint * wp.vec3(1.0, 0.85, 0.6)


def spectrum(count):
    """Waves of Phillips's spectrum, downwind of x + y / 2, at random."""
    rng = np.random.default_rng(7)
    length = np.geomspace(0.7, 18.0, count)
    k = 2.0 * np.pi / length
    way = np.arctan2(0.5, 1.0) + rng.normal(0.0, 0.5, count)
    swell = WIND * WIND / GRAVITY
    energy = np.exp(-1.0 / (k * swell) ** 2) / k**4
    amplitude = 0.45 * np.sqrt(energy / energy.sum()) * rng.rayleigh(1.0, count)
    rows = cast(Any, np.zeros(count, cast(Any, Wave).numpy_dtype()))
    rows["k"] = (k * [np.cos(way), np.sin(way)]).T
    rows["amplitude"], rows["frequency"] = amplitude, np.sqrt(GRAVITY * k)
    rows["phase"] = rng.uniform(0.0, 2.0 * np.pi, count)
    return rows


def exact(rows, spacing, t, size):
    """Heights and slopes in double precision, with the numbers that the kernel has."""
    x = np.arange(size) * float(np.float32(spacing))
    height, slope = np.zeros((size, size)), np.zeros((size, size, 2))
    for row in rows:
        k = row["k"].astype(float)
        way = k[0] * x[:, None] + k[1] * x + float(row["phase"])
        angle = way - float(row["frequency"]) * float(np.float32(t))
        height += float(row["amplitude"]) * np.cos(angle)
        slope -= k * (float(row["amplitude"]) * np.sin(angle))[..., None]
    return height, slope


def draw(path, color):
    figure = plt.figure(figsize=(4.8, 4.8), dpi=80)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(np.clip(color, 0.0, 1.0).transpose(1, 0, 2)[::-1], interpolation="bilinear")
    axes.axis("off")
    figure.savefig(path)
    plt.close(figure)


def main(device, size, count, frames, output):
    rows, spacing = spectrum(count), EDGE / size
    waves = wp.array(rows, dtype=Wave, device=device)
    height = wp.zeros((size, size), dtype=float, device=device)
    slope = wp.zeros((size, size), dtype=wp.vec2, device=device)
    color = wp.zeros((size, size), dtype=wp.vec3, device=device)
    light, t = wp.normalize(wp.vec3(0.3, 0.9, 0.45)), 0.0

    def frame(t):
        wp.launch(surface, (size, size), [waves, spacing, t, height, slope], device=device)
        wp.launch(shade, (size, size), [slope, light, color], device=device)

    frame(0.0)
    wp.synchronize()
    start = time.perf_counter()
    for number in range(frames):
        t = number / 24.0
        frame(t)
    wp.synchronize()
    took = time.perf_counter() - start
    heights, slopes = exact(rows, spacing, t, size)
    error = np.abs(height.numpy() - heights).max(), np.abs(slope.numpy() - slopes).max()
    output.mkdir(parents=True, exist_ok=True)
    draw(output / f"ocean_{device.replace(':', '')}.png", color.numpy())
    print("| device | points | waves | ms a frame | error of heights [m] | error of slopes |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    times = f"{1e3 * took / frames:.2f}"
    print(f"| {device} | {size * size} | {count} | {times} | {error[0]:.1e} | {error[1]:.1e} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--waves", type=int, default=96)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    wp.config.quiet = True
    main(options.device, options.size, options.waves, options.frames, options.output)
