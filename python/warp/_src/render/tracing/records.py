"""Records of the path tracer: materials, shapes, media, the world and the camera."""

import warp as wp


@wp.struct
class Material:
    """Scattering at a surface: a diffuse base under a clear coat, a metal, or clear glass."""

    color: wp.vec3
    emission: wp.vec3
    absorption: wp.vec3
    roughness: float
    metallic: float
    specular: float
    transmission: float
    ior: float
    texture: int
    checker: float


@wp.struct
class Shape:
    """A mesh and where its vertex data begin; -1 for data that it has not."""

    mesh: wp.uint64
    normals: int
    uvs: int
    colors: int


@wp.struct
class Instance:
    """A shape placed by an affine map."""

    linear: wp.mat33
    inverse: wp.mat33
    origin: wp.vec3
    tint: wp.vec3
    shape: int
    material: int


@wp.struct
class Image:
    """A texture: rows of texels in the array of all."""

    start: int
    width: int
    height: int


@wp.struct
class Medium:
    """A participating medium: densities in a NanoVDB grid inside a box."""

    volume: wp.uint64
    low: wp.vec3
    high: wp.vec3
    albedo: wp.vec3
    emission: wp.vec3
    scale: float
    majorant: float
    asymmetry: float


@wp.struct
class LevelSet:
    """A surface: the zero of signed distances in a NanoVDB grid inside a box."""

    volume: wp.uint64
    low: wp.vec3
    high: wp.vec3
    tint: wp.vec3
    reach: float
    material: int


@wp.struct
class World:
    """Everything that rays meet."""

    instances: wp.array(dtype=Instance)
    instance_tree: wp.uint64
    instance_count: int
    shapes: wp.array(dtype=Shape)
    normals: wp.array(dtype=wp.vec3)
    uvs: wp.array(dtype=wp.vec2)
    colors: wp.array(dtype=wp.vec3)
    spheres: wp.array(dtype=wp.vec4)
    sphere_colors: wp.array(dtype=wp.vec3)
    sphere_materials: wp.array(dtype=int)
    sphere_tree: wp.uint64
    sphere_count: int
    lamps: wp.array(dtype=int)
    lamp_count: int
    materials: wp.array(dtype=Material)
    images: wp.array(dtype=Image)
    texels: wp.array(dtype=wp.vec3)
    media: wp.array(dtype=Medium)
    medium_count: int
    level_sets: wp.array(dtype=LevelSet)
    level_set_count: int
    sky: wp.array2d(dtype=wp.vec3)
    up: wp.vec3
    east: wp.vec3
    north: wp.vec3
    sun: wp.vec3
    sun_radiance: wp.vec3
    sun_cosine: float
    reach: float


@wp.struct
class Camera:
    """A thin lens."""

    eye: wp.vec3
    right: wp.vec3
    up: wp.vec3
    forward: wp.vec3
    tangent: float
    aperture: float
    focus: float


@wp.struct
class Film:
    """Sums over the samples of each pixel."""

    color: wp.array2d(dtype=wp.vec3)
    albedo: wp.array2d(dtype=wp.vec3)
    normal: wp.array2d(dtype=wp.vec4)
    square: wp.array2d(dtype=float)
    rejected: wp.array(dtype=int)


@wp.struct
class Hit:
    """The nearest surface along a ray; its material is -1 where there is none."""

    t: float
    facing: wp.vec3
    normal: wp.vec3
    tint: wp.vec3
    uv: wp.vec2
    material: int
    lamp: int


@wp.struct
class Light:
    """A sampled light: its direction, distance and radiance, and the density of the sample."""

    dir: wp.vec3
    radiance: wp.vec3
    distance: float
    density: float


@wp.struct
class Path:
    """A path of light in progress, and its first surface."""

    origin: wp.vec3
    dir: wp.vec3
    throughput: wp.vec3
    color: wp.vec3
    albedo: wp.vec3
    normal: wp.vec4
    density: float
    inside: int
    bounce: int
    alive: int
