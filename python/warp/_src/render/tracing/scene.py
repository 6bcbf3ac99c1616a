"""`Scene`: what a path tracer draws, and pictures of it."""

import math

import numpy as np

import warp as wp
from warp._src.render.tracing import film as films
from warp._src.render.tracing import skies
from warp._src.render.tracing.materials import material_row, texels_of
from warp._src.render.tracing.parts import (
    Instances,
    SceneMesh,
    Spheres,
    level_set_row,
    medium_row,
)
from warp._src.render.tracing.paths import trace
from warp._src.render.tracing.records import Camera, Film
from warp._src.render.tracing.voxels import extent_of
from warp._src.render.tracing.worlds import world_of
from warp.extend import notice

_UNLIMITED = 1.0e30


class Scene:
    """Meshes, spheres, volumes and height fields under a sky, drawn by path tracing.

    Each sample of a pixel follows one path of light through reflections, glass and smoke, so the
    error falls with the root of the number of samples; `render` may remove noise afterwards.

    Args:
        width, height: of pictures in pixels.
        device: that traces, the default one if None.
        up: the direction of the zenith.

    Example:
        >>> import warp.render
        >>> scene = warp.render.Scene(64, 36, device="cpu")
        >>> ball = scene.add_spheres([[0.0, 0.0, 0.0]], 1.0, color=(0.8, 0.3, 0.2))
        >>> scene.set_camera(eye=(0.0, 1.0, 4.0), target=(0.0, 0.0, 0.0))
        >>> scene.render(samples=4).shape
        (36, 64, 3)
    """

    def __init__(self, width=1280, height=720, device=None, up=(0.0, 1.0, 0.0)):
        if not (0 < width <= 16384 and 0 < height <= 16384):
            raise ValueError(f"expects 1 to 16384 pixels each way, but got {width} x {height}")
        self.width, self.height = int(width), int(height)
        self.device = wp.get_device(device)
        self.up = _unit(up, "up")
        self.meshes, self.instances, self.spheres = [], [], []
        self.media, self.level_sets, self.volumes = [], [], []
        self.materials, self.images = [], []
        self.sky, self.sun = None, None
        self.exposure, self.film_curve = 1.0, True
        self.depth: int = 8
        self.limit: float | None = None
        self.samples = 0
        self._world, self._film, self._camera = None, None, None
        self.frames = []
        self.set_sky()
        self.set_camera()

    def set_camera(
        self, eye=(0.0, 1.0, 5.0), target=(0.0, 0.0, 0.0), fov=40.0, aperture=0.0, focus=None
    ) -> None:
        """Looks from `eye` to `target`.

        Args:
            fov: vertical angle of view in degrees.
            aperture: radius of the lens; what is nearer or farther than `focus` is blurred by it.
            focus: distance that is sharp, that of the target if None.
        """
        forward = np.asarray(target, float) - np.asarray(eye, float)
        distance = float(np.linalg.norm(forward))
        right = np.cross(_unit(forward, "target - eye"), self.up)
        if not 0.0 < fov < 180.0:
            raise ValueError(f"expects an angle of view between 0 and 180, but got {fov}")
        if np.linalg.norm(right) < 1.0e-6:
            raise ValueError("expects a view that is not along the scene's 'up'")
        camera = Camera()
        right = right / np.linalg.norm(right)
        forward = forward / distance
        camera.eye, camera.right = wp.vec3(*map(float, eye)), wp.vec3(*right)
        camera.up, camera.forward = wp.vec3(*np.cross(right, forward)), wp.vec3(*forward)
        camera.tangent = math.tan(math.radians(fov) / 2.0)
        camera.aperture = float(aperture)
        camera.focus = float(distance if focus is None else focus)
        self._camera = camera
        self.view = {"eye": list(map(float, eye)), "target": list(map(float, target)), "fov": fov}
        self.clear()

    def set_sky(
        self,
        sun=None,
        power=6.0,
        haze=1.0,
        size=0.6,
        top=(0.35, 0.55, 0.95),
        horizon=(0.9, 0.95, 1.0),
        ground=(0.35, 0.33, 0.3),
        image=None,
    ) -> None:
        """Lights the scene from all around.

        Args:
            sun: direction to the sun, for a sky of air that scatters its light; None is a sky
                between two colours without a sun.
            power: of the sun above the air.
            haze: of the air; 1 is a clear day.
            size: of the sun, its half angle in degrees; the real one has 0.27.
            top, horizon: colours of the sky without a sun.
            ground: colour below the horizon; with a sun what it reflects of the horizon.
            image: radiance from all around of shape (rows, columns, 3), the zenith first.
        """
        self.sun = None
        if image is not None:
            rows = np.asarray(image, np.float32)
            if rows.ndim != 3 or rows.shape[2] != 3 or rows.size == 0:
                raise ValueError(f"expects a sky of shape (rows, columns, 3), but got {rows.shape}")
            self.sky = wp.array(rows, dtype=wp.vec3, device=self.device)
        elif sun is None:
            colors = (np.asarray(c, np.float32) for c in (top, horizon, ground))
            self.sky = skies.table_of_colors(*colors, self.device)
        else:
            frame = np.stack(self._axes())
            local = frame @ _unit(sun, "sun")
            half = math.radians(size)
            table, irradiance = skies.table_of_air(
                local, float(power), float(haze), ground, self.device
            )
            self.sky = table
            solid = 2.0 * math.pi * (1.0 - math.cos(half))
            self.sun = (_unit(sun, "sun"), irradiance / solid, math.cos(half))
        self._changed()

    def add_mesh(
        self,
        points,
        indices,
        transforms=None,
        smooth=True,
        uvs=None,
        colors=None,
        tints=None,
        **material,
    ):
        """Adds a triangle mesh, once or at every transform.

        Args:
            points: of shape (n, 3), array of Warp or NumPy.
            indices: three for each face.
            transforms: of shape (n, 7), as wp.transform, or (n, 4, 4).
            smooth: shades by normals of the points, not of the faces.
            uvs: texture coordinates of the points.
            colors: of the points, factors of the material's colour.
            tints: factors of the colour for each transform.
            material: see `add_material`.

        Returns:
            the instances; their `mesh` has `update(points)`, they have `update(transforms)`.
        """
        mesh = SceneMesh(self, points, indices, smooth, uvs, colors)
        self.meshes.append(mesh)
        return self.add_instances(mesh, transforms, tints, **material)

    def add_instances(self, mesh, transforms=None, tints=None, **material):
        """Adds copies of a mesh that `add_mesh` has added."""
        mesh = getattr(mesh, "mesh", mesh) if isinstance(mesh, Instances) else mesh
        copies = Instances(self, mesh, transforms, tints, self.add_material(**material))
        self.instances.append(copies)
        self._changed()
        return copies

    def add_spheres(self, centers, radii, colors=None, **material):
        """Adds spheres; those with an `emission` are lamps.

        Args:
            centers: of shape (n, 3).
            radii: one for all, or one for each.
            colors: of shape (n, 3), factors of the material's colour.
            material: see `add_material`.
        """
        spheres = Spheres(self, centers, radii, colors, self.add_material(**material))
        self.spheres.append(spheres)
        self._changed()
        return spheres

    def add_height_field(self, heights, low, high, **options):
        """Adds a surface over a grid, of triangles.

        Args:
            heights: of shape (n, m), along `up`, at the points of a grid over the other two axes.
            low, high: corners of the grid along these axes: of x and z where y is up, of x and y
                where z is up.
            options: as of `add_mesh`.

        Returns:
            the instance; `update_heights(heights)` moves it.
        """
        from warp._src.render.tracing.grids import HeightField

        field = HeightField(self, heights, low, high)
        placed = self.add_mesh(field.points(heights), field.indices(), **options)
        placed.update_heights = lambda heights: placed.mesh.update(field.points(heights))
        return placed

    def add_tubes(self, lines, radius, sides=8, **material):
        """Adds polylines as tubes; each has shape (n, 3)."""
        from warp._src.render.tracing.grids import tubes

        points, indices = tubes(lines, radius, sides)
        return self.add_mesh(points, indices, **material)

    def add_volume(
        self,
        volume,
        scale=1.0,
        albedo=(0.9, 0.9, 0.9),
        emission=(0.0, 0.0, 0.0),
        asymmetry=0.0,
        most=None,
    ):
        """Adds smoke or dust: a grid of densities through which light scatters.

        Args:
            volume: a `wp.Volume` of floats.
            scale: extinction for a density of 1, over the unit of length.
            albedo: the part of the light that goes on, by colour.
            emission: radiance that a collision adds.
            asymmetry: of the phase function, from -1 to 1; positive scatters forward.
            most: largest density; found if None.

        Returns:
            the number of the medium, for `replace_volume`.
        """
        low, high, largest = extent_of(volume, most)
        row = medium_row(volume, low, high, albedo, emission, scale, largest, asymmetry)
        self.media.append(row)
        self.volumes.append(volume)
        self._changed()
        return len(self.media) - 1

    def replace_volume(self, number, volume, most=None) -> None:
        """Gives a medium another grid."""
        low, high, largest = extent_of(volume, most)
        row = self.media[number]
        row["volume"], row["low"], row["high"] = volume.id, low, high
        row["majorant"] = row["scale"] * largest
        self.volumes.append(volume)
        self._changed()

    def add_level_set(self, volume, tint=(1.0, 1.0, 1.0), **material):
        """Adds the surface where a grid of signed distances is zero."""
        low, high, _ = extent_of(volume, 1.0)
        voxel = float(min(volume.get_voxel_size()))
        number = self.add_material(**material)
        self.level_sets.append(level_set_row(volume, low, high, tint, voxel, number))
        self.volumes.append(volume)
        self._changed()

    def add_material(
        self,
        color=(0.8, 0.8, 0.8),
        roughness=0.5,
        metallic=0.0,
        specular=0.04,
        transmission=0.0,
        ior=1.5,
        emission=(0.0, 0.0, 0.0),
        absorption=(0.0, 0.0, 0.0),
        texture=None,
        checker=0.0,
    ) -> int:
        """Adds a material, as the keywords of `add_mesh` and the others do.

        Args:
            color: the part of the light that the base or the metal reflects.
            roughness: of coat and metal, 0 to 1.
            metallic: 1 is a metal, 0 a base under a clear coat.
            specular: what the coat reflects straight on; 0 is no coat.
            transmission: the part that behaves as clear glass.
            ior: index of refraction of that glass.
            emission: radiance that the surface sends out.
            absorption: of the glass, over the unit of length.
            texture: picture of shape (rows, columns, 3) in linear colour that multiplies the
                colour, repeated.
            checker: edge of a checkerboard's fields in texture coordinates; 0 is none.
        """
        given = {"color": color, "emission": emission, "absorption": absorption}
        given |= {"roughness": roughness, "metallic": metallic, "specular": specular}
        given |= {"transmission": transmission, "ior": ior, "checker": checker}
        row = material_row(given)
        if texture is not None:
            row["texture"] = len(self.images)
            self.images.append(texels_of(texture))
        self.materials.append(row)
        self._changed()
        return len(self.materials) - 1

    def clear(self) -> None:
        """Forgets all samples."""
        self.samples, self._film = 0, None

    def accumulate(self, samples=1, seed=0) -> None:
        """Adds samples to those that the film has."""
        if samples < 1:
            raise ValueError(f"expects one or more samples, but got {samples}")
        if self._world is None:
            self._world = world_of(self)
        if self._film is None:
            self._film = _empty_film((self.height, self.width), self.device)
        limit = _UNLIMITED if self.limit is None else float(self.limit)
        shape = (self.height, self.width)
        # Few samples a launch, so that it can be interrupted.
        for _ in range(samples):
            inputs = [self._world, self._camera, self._film, self.samples, 1]
            inputs += [self.depth, limit, int(seed)]
            wp.launch(trace, shape, inputs, device=self.device)
            self.samples += 1
        rejected = int(self._film.rejected.numpy()[0])
        if rejected:
            notice(f"{rejected} samples of {self.samples * shape[0] * shape[1]} were not finite")

    def radiance(self, denoise=False):
        """The mean of the samples so far, as linear colour of shape (height, width, 3)."""
        if self.samples == 0:
            raise ValueError("expects samples, call 'render' or 'accumulate' first")
        return self._light(denoise).numpy()

    def render(self, samples=64, denoise=True, seed=0):
        """A picture of shape (height, width, 3), from 0 to 1 in sRGB.

        The samples are added to those that the film has; `clear` and any change forget these.
        """
        self.accumulate(samples, seed)
        return self.picture(denoise)

    def picture(self, denoise=True):
        """The picture of the samples so far."""
        light = self._light(denoise)
        pixels = wp.empty_like(light)
        inputs = [light, float(self.exposure), bool(self.film_curve)]
        wp.launch(films.develop, light.shape, inputs, [pixels], device=self.device)
        return pixels.numpy()

    def save(self, path, samples=64, denoise=True, seed=0) -> None:
        """Renders a picture and writes it, in the format that the name's ending asks for."""
        from warp._src.render.pictures import save_picture

        save_picture(path, self.render(samples, denoise, seed))

    def keep_frame(self) -> None:
        """Keeps where everything is now, as a frame for `save_html`."""
        from warp._src.render.tracing.pages import Frame

        self.frames.append(Frame(self))

    def save_html(
        self, path, title="Warp", fps=30.0, max_triangles=2_000_000, decimate=False
    ) -> None:
        """Writes one page that shows the scene in a browser: orbit, play and scrub.

        It needs no network and shows meshes and spheres under a simple light. The frames that
        `keep_frame` has kept can be played; without one the scene stands still.

        Args:
            max_triangles: that a page may have.
            decimate: draws a coarser copy of a scene that has more.

        Raises:
            ValueError: there are more triangles, or parts were added between kept frames.
        """
        from warp._src.render.tracing.pages import save_page

        save_page(self, path, title, fps, max_triangles, decimate)

    def save_model(self, path) -> None:
        """Writes meshes and spheres for other programs.

        Args:
            path: of the file: `.glb`, `.gltf`, `.obj`, `.ply` or `.stl` by trimesh, or `.usd`,
                `.usda` or `.usdc` by usd-core, with materials; USD has the lights too.
        """
        from warp._src.render.tracing.exports import save_model

        save_model(self, path)

    def _light(self, denoise):
        if denoise:
            return films.denoised(self._film, float(self.samples), 5)
        out = wp.zeros((self.height, self.width), dtype=wp.vec3, device=self.device)
        inputs = [self._film, float(self.samples)]
        wp.launch(films.mean, out.shape, inputs, [out], device=self.device)
        return out

    def _axes(self):
        """East, north and up."""
        other = (0.0, 0.0, 1.0) if abs(self.up[2]) < 0.9 else (0.0, 1.0, 0.0)
        east = np.cross(other, self.up)
        if abs(self.up[2]) >= 0.9:
            east = np.array([1.0, 0.0, 0.0])
            east = east - self.up * (east @ self.up)
        east = east / np.linalg.norm(east)
        return east, np.cross(self.up, east), self.up

    def _changed(self):
        self._world = None
        self.clear()


def _unit(values, name):
    vector = np.asarray(values, float)
    length = np.linalg.norm(vector) if vector.shape == (3,) else math.nan
    if not 0.0 < length < math.inf:
        raise ValueError(f"expects '{name}' as a direction of three numbers, but got {values}")
    return vector / length


def _empty_film(shape, device):
    film = Film()
    film.color = wp.zeros(shape, dtype=wp.vec3, device=device)
    film.albedo = wp.zeros(shape, dtype=wp.vec3, device=device)
    film.normal = wp.zeros(shape, dtype=wp.vec4, device=device)
    film.square = wp.zeros(shape, dtype=float, device=device)
    film.rejected = wp.zeros(1, dtype=int, device=device)
    return film
