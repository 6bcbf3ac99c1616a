"""Random numbers and directions, and their densities.

Sources: E. Heitz, Sampling the GGX distribution of visible normals, JCGT 7(4), 2018;
T. Duff et al., Building an orthonormal basis, revisited, JCGT 6(1), 2017.
"""

import warp as wp

PI = wp.constant(3.14159265358979)


@wp.func
def luminance(c: wp.vec3):
    return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]


@wp.func
def basis(n: wp.vec3):
    """The columns are two tangents and the normal."""
    sign = wp.where(n[2] >= 0.0, 1.0, -1.0)
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    return wp.matrix_from_cols(
        wp.vec3(1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]),
        wp.vec3(b, sign + n[1] * n[1] * a, -n[1]),
        n,
    )


@wp.func
def rotated(step: wp.uint32, dimension: int, offset: wp.uint32):
    """One coordinate of a rank-1 sequence in six dimensions, rotated for each pixel."""
    alpha = wp.uint32(3859688306)
    if dimension == 1:
        alpha = wp.uint32(3468523226)
    if dimension == 2:
        alpha = wp.uint32(3117001274)
    if dimension == 3:
        alpha = wp.uint32(2801104767)
    if dimension == 4:
        alpha = wp.uint32(2517223199)
    if dimension == 5:
        alpha = wp.uint32(2262111973)
    word = (step * alpha + offset) >> wp.uint32(8)
    return float(word) * 5.9604644775390625e-8


@wp.func
def cosine_direction(u: float, v: float):
    """A direction about z with density cosine / pi."""
    r = wp.sqrt(u)
    phi = 2.0 * PI * v
    return wp.vec3(r * wp.cos(phi), r * wp.sin(phi), wp.sqrt(wp.max(0.0, 1.0 - u)))


@wp.func
def cone_direction(cosine: float, u: float, v: float):
    """A direction about z, uniform in the cone of that half angle."""
    z = 1.0 - u * (1.0 - cosine)
    r = wp.sqrt(wp.max(0.0, 1.0 - z * z))
    phi = 2.0 * PI * v
    return wp.vec3(r * wp.cos(phi), r * wp.sin(phi), z)


@wp.func
def cone_density(cosine: float):
    return 1.0 / (2.0 * PI * wp.max(1.0 - cosine, 1.0e-7))


@wp.func
def ggx(alpha: float, h: wp.vec3):
    """The distribution of microfacet normals."""
    a2 = alpha * alpha
    d = (h[0] * h[0] + h[1] * h[1]) / a2 + h[2] * h[2]
    return 1.0 / (PI * a2 * d * d)


@wp.func
def smith(alpha: float, w: wp.vec3):
    """Smith's Lambda of a direction."""
    c2 = wp.max(w[2] * w[2], 1.0e-12)
    return 0.5 * (wp.sqrt(1.0 + alpha * alpha * (1.0 - w[2] * w[2]) / c2) - 1.0)


@wp.func
def visible_normal(alpha: float, w: wp.vec3, u: float, v: float):
    """A microfacet normal, by the density of those visible from w."""
    s = wp.normalize(wp.vec3(alpha * w[0], alpha * w[1], w[2]))
    flat = s[0] * s[0] + s[1] * s[1]
    x = wp.vec3(1.0, 0.0, 0.0)
    if flat > 1.0e-12:
        x = wp.vec3(-s[1], s[0], 0.0) / wp.sqrt(flat)
    y = wp.cross(s, x)
    r = wp.sqrt(u)
    phi = 2.0 * PI * v
    a = r * wp.cos(phi)
    b = r * wp.sin(phi)
    mix = 0.5 * (1.0 + s[2])
    b = (1.0 - mix) * wp.sqrt(wp.max(0.0, 1.0 - a * a)) + mix * b
    h = a * x + b * y + wp.sqrt(wp.max(0.0, 1.0 - a * a - b * b)) * s
    return wp.normalize(wp.vec3(alpha * h[0], alpha * h[1], wp.max(h[2], 1.0e-6)))


@wp.func
def phase_density(asymmetry: float, cosine: float):
    """Henyey and Greenstein's phase function, of the cosine to the direction of travel."""
    g = asymmetry
    d = 1.0 + g * g - 2.0 * g * cosine
    return (1.0 - g * g) / (4.0 * PI * d * wp.sqrt(d))


@wp.func
def phase_direction(asymmetry: float, u: float, v: float):
    """A direction about z with the density of that phase function."""
    g = asymmetry
    z = 1.0 - 2.0 * u
    if wp.abs(g) > 1.0e-3:
        q = (1.0 - g * g) / (1.0 + g - 2.0 * g * u)
        z = wp.clamp((1.0 + g * g - q * q) / (2.0 * g), -1.0, 1.0)
    r = wp.sqrt(wp.max(0.0, 1.0 - z * z))
    phi = 2.0 * PI * v
    return wp.vec3(r * wp.cos(phi), r * wp.sin(phi), z)
