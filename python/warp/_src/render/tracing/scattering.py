"""Scattering at surfaces: density, value and samples of each material's lobes.

A material has a diffuse base under a clear coat of microfacets, or is a metal of microfacets, by
its `metallic`; `transmission` replaces both by a smooth dielectric. Light that would scatter
between microfacets more than once is lost, as in B. Walter et al., Microfacet models for
refraction through rough surfaces, EGSR 2007.
"""

import warp as wp
from warp._src.render.tracing.records import Material
from warp._src.render.tracing.sampling import (
    PI,
    cosine_direction,
    ggx,
    luminance,
    smith,
    visible_normal,
)


@wp.func
def alpha_of(m: Material):
    return wp.max(m.roughness * m.roughness, 1.0e-3)


@wp.func
def schlick(f0: float, cosine: float):
    """Fresnel's reflectance of a coat; a coat of reflectance zero is none at any angle."""
    x = wp.clamp(1.0 - cosine, 0.0, 1.0)
    x2 = x * x
    return f0 + (wp.min(1.0, 50.0 * f0) - f0) * x2 * x2 * x


@wp.func
def reflectance(m: Material, color: wp.vec3, cosine: float):
    """Fresnel's reflectance of the microfacets: the coat's and the metal's, mixed."""
    x = wp.clamp(1.0 - cosine, 0.0, 1.0)
    x5 = x * x * x * x * x
    metal = color + (wp.vec3(1.0) - color) * x5
    coat = schlick(m.specular, cosine)
    return wp.vec3(coat) * (1.0 - m.metallic) + metal * m.metallic


@wp.func
def specular_share(m: Material, color: wp.vec3, cosine: float):
    """The probability with which microfacets are sampled."""
    f = luminance(reflectance(m, color, cosine))
    base = luminance(color) * (1.0 - m.metallic)
    if f + base <= 0.0:
        return 0.0
    share = f / (f + base)
    if f > 0.0 and base > 0.0:
        share = wp.clamp(share, 0.1, 0.9)
    return share


@wp.func
def scatter_density(m: Material, color: wp.vec3, wo: wp.vec3, wi: wp.vec3):
    """The density of `scatter` choosing wi; directions are about the normal."""
    if wi[2] <= 0.0 or wo[2] <= 0.0:
        return 0.0
    share = specular_share(m, color, wo[2])
    alpha = alpha_of(m)
    h = wp.normalize(wi + wo)
    microfacets = ggx(alpha, h) / ((1.0 + smith(alpha, wo)) * 4.0 * wo[2])
    return share * microfacets + (1.0 - share) * wi[2] / PI


@wp.func
def scatter_value(m: Material, color: wp.vec3, wo: wp.vec3, wi: wp.vec3):
    """The scattering function times the cosine of wi."""
    if wi[2] <= 0.0 or wo[2] <= 0.0:
        return wp.vec3(0.0)
    alpha = alpha_of(m)
    h = wp.normalize(wi + wo)
    f = reflectance(m, color, wp.dot(wi, h))
    masking = 1.0 / (1.0 + smith(alpha, wo) + smith(alpha, wi))
    value = f * (ggx(alpha, h) * masking / (4.0 * wo[2]))
    through = (1.0 - schlick(m.specular, wo[2])) * (1.0 - schlick(m.specular, wi[2]))
    return value + color * ((1.0 - m.metallic) * through * wi[2] / PI)


@wp.func
def scatter(m: Material, color: wp.vec3, wo: wp.vec3, choice: float, u: float, v: float):
    """A direction about the normal, by `scatter_density`."""
    wi = cosine_direction(u, v)
    if choice < specular_share(m, color, wo[2]):
        h = visible_normal(alpha_of(m), wo, u, v)
        wi = 2.0 * wp.dot(wo, h) * h - wo
    return wi


@wp.func
def dielectric(eta: float, cosine: float):
    """Fresnel's reflectance of a smooth border, eta being the index ahead over the one here."""
    sine2 = (1.0 - cosine * cosine) / (eta * eta)
    if sine2 >= 1.0:
        return 1.0
    inner = wp.sqrt(1.0 - sine2)
    parallel = (eta * cosine - inner) / (eta * cosine + inner)
    across = (cosine - eta * inner) / (cosine + eta * inner)
    return 0.5 * (parallel * parallel + across * across)
