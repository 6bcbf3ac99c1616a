"""Film: means of samples, removal of noise, exposure and colour.

H. Dammertz et al., Edge-avoiding a-trous wavelet transform for fast global illumination filtering,
HPG 2010; C. Schied et al., Spatiotemporal variance-guided filtering, HPG 2017.
"""

import warp as wp
from warp._src.render.tracing.records import Film
from warp._src.render.tracing.sampling import luminance


@wp.func
def divisor(albedo: wp.vec3):
    return wp.vec3(wp.max(albedo[0], 0.02), wp.max(albedo[1], 0.02), wp.max(albedo[2], 0.02))


@wp.kernel(enable_backward=False)
def mean(film: Film, count: float, out: wp.array2d(dtype=wp.vec3)):
    i, j = wp.tid()
    out[i, j] = film.color[i, j] / count


@wp.kernel(enable_backward=False)
def split(
    film: Film,
    count: float,
    light: wp.array2d(dtype=wp.vec3),
    variance: wp.array2d(dtype=float),
    guide: wp.array2d(dtype=wp.vec4),
):
    """Light without the surface's colour, its variance, and what guides the filter."""
    i, j = wp.tid()
    color = film.color[i, j] / count
    albedo = divisor(film.albedo[i, j] / count)
    light[i, j] = wp.cw_div(color, albedo)
    bright = luminance(color)
    spread = wp.max(0.0, film.square[i, j] / count - bright * bright)
    tone = luminance(albedo)
    variance[i, j] = spread / (count * tone * tone)
    guide[i, j] = film.normal[i, j] / count


@wp.func
def smoothed_variance(variance: wp.array2d(dtype=float), i: int, j: int):
    """Three by three, binomial: the variance of few samples is noise itself."""
    total = float(0.0)
    weights = float(0.0)
    for a in range(-1, 2):
        for b in range(-1, 2):
            y = i + a
            x = j + b
            if y >= 0 and x >= 0 and y < variance.shape[0] and x < variance.shape[1]:
                w = float((2 - wp.abs(a)) * (2 - wp.abs(b)))
                total += w * variance[y, x]
                weights += w
    return total / weights


@wp.kernel(enable_backward=False)
def smooth(
    light: wp.array2d(dtype=wp.vec3),
    variance: wp.array2d(dtype=float),
    guide: wp.array2d(dtype=wp.vec4),
    albedo: wp.array2d(dtype=wp.vec3),
    count: float,
    hole: int,
    out: wp.array2d(dtype=wp.vec3),
    out_variance: wp.array2d(dtype=float),
):
    """One level of the filter: 5 x 5 samples, `hole` pixels apart."""
    i, j = wp.tid()
    here = light[i, j]
    g = guide[i, j]
    n = wp.vec3(g[0], g[1], g[2])
    tone = albedo[i, j] / count
    bright = luminance(here)
    allowed = 3.0 * wp.sqrt(smoothed_variance(variance, i, j)) + 1.0e-4 + 0.01 * bright
    total = here
    weights = float(1.0)
    squares = variance[i, j]
    for a in range(-2, 3):
        for b in range(-2, 3):
            y = i + a * hole
            x = j + b * hole
            inside = y >= 0 and x >= 0 and y < light.shape[0] and x < light.shape[1]
            if inside and (a != 0 or b != 0):
                q = guide[y, x]
                there = light[y, x]
                away = wp.abs(luminance(there) - bright) / allowed
                turn = wp.length_sq(wp.vec3(q[0], q[1], q[2]) - n) * 16.0
                steps = float(hole) * (wp.abs(float(a)) + wp.abs(float(b)))
                depth = wp.abs(q[3] - g[3]) / (0.01 * wp.min(g[3], q[3]) * steps + 1.0e-4)
                shift = wp.length_sq(albedo[y, x] / count - tone) * 100.0
                kernel = wp.exp(-0.35 * float(a * a + b * b))
                w = kernel * wp.exp(-away - turn - depth - shift)
                total += w * there
                weights += w
                squares += w * w * variance[y, x]
    out[i, j] = total / weights
    out_variance[i, j] = squares / (weights * weights)


@wp.kernel(enable_backward=False)
def join(film: Film, count: float, light: wp.array2d(dtype=wp.vec3)):
    """Gives light the surface's colour again."""
    i, j = wp.tid()
    light[i, j] = wp.cw_mul(light[i, j], divisor(film.albedo[i, j] / count))


@wp.func
def filmic(x: float):
    """K. Narkowicz's fit of the film curve of the Academy Color Encoding System."""
    y = wp.max(0.0, 0.6 * x)
    return wp.clamp(y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14), 0.0, 1.0)


@wp.func
def display(x: float):
    """The curve of sRGB."""
    y = wp.clamp(x, 0.0, 1.0)
    curved = 1.055 * wp.pow(wp.max(y, 1.0e-6), 1.0 / 2.4) - 0.055
    return wp.where(y <= 0.0031308, 12.92 * y, curved)


@wp.kernel(enable_backward=False)
def develop(
    light: wp.array2d(dtype=wp.vec3),
    exposure: float,
    film_curve: bool,
    pixels: wp.array2d(dtype=wp.vec3),
):
    """Exposure, tone curve and display curve."""
    i, j = wp.tid()
    c = light[i, j] * exposure
    if film_curve:
        c = wp.vec3(filmic(c[0]), filmic(c[1]), filmic(c[2]))
    pixels[i, j] = wp.vec3(display(c[0]), display(c[1]), display(c[2]))


def denoised(film, count, levels):
    """Light of a film without noise; `levels` widths of the filter, each twice the last."""
    shape, device = film.color.shape, film.color.device
    light = [wp.zeros(shape, dtype=wp.vec3, device=device) for _ in range(2)]
    variance = [wp.zeros(shape, dtype=float, device=device) for _ in range(2)]
    guide = wp.zeros(shape, dtype=wp.vec4, device=device)
    outputs = [light[0], variance[0], guide]
    wp.launch(split, shape, [film, count], outputs, device=device)
    for level in range(levels):
        a, b = level % 2, (level + 1) % 2
        inputs = [light[a], variance[a], guide, film.albedo, count, 1 << level]
        wp.launch(smooth, shape, inputs, [light[b], variance[b]], device=device)
    done = light[levels % 2]
    wp.launch(join, shape, [film, count, done], device=device)
    return done
