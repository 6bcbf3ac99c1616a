"""`Viewer`: a scene in a browser while a program runs, by viser."""

import numpy as np

from warp._src.render.tracing.decimation import clustered
from warp._src.render.tracing.pages import kept_share
from warp.extend import errors

# More spheres than this are drawn as points.
_BALLS = 20_000


class Viewer:
    """Shows a scene in a browser and follows what changes.

    Args:
        scene: a `Scene`.
        backend: "viser", the only one; `Scene.save_html` writes pages without a server.
        port: of the server; 0 takes a free one.
        max_triangles: that a browser gets.
        decimate: shows a coarser copy of a scene that has more.

    Attributes:
        server: the `viser.ViserServer`, for controls of one's own.

    Raises:
        ImportError: viser is not installed.
        ValueError: there is no such backend, or the scene has more triangles.

    Example:
        >>> import warp.render
        >>> viewer = warp.render.Viewer(scene)  # doctest: +SKIP
        >>> for _ in range(1000):  # doctest: +SKIP
        ...     balls.update(positions)
        ...     viewer.update()
    """

    def __init__(self, scene, backend="viser", port=8080, max_triangles=2_000_000, decimate=False):
        if backend != "viser":
            raise ValueError(
                f"expects the backend 'viser', but got '{backend}'; pages without a server are "
                "written by 'Scene.save_html'"
            )
        try:
            import viser
        except ImportError as error:
            raise errors.absent("viser", "warp.render.Viewer") from error
        self.scene = scene
        self._share = kept_share(scene, max_triangles, decimate, "the viewer")
        self._kept = {}
        self.server = viser.ViserServer(port=port, verbose=False)
        self.server.scene.set_up_direction(tuple(map(float, scene.up)))
        self._look()
        self.update()

    def update(self) -> None:
        """Shows where everything is now."""
        with self.server.atomic():
            for number, mesh in enumerate(self.scene.meshes):
                for place, copies in enumerate(self.scene.instances):
                    if copies.mesh is mesh:
                        self._show_mesh(f"/mesh{number}/{place}", mesh, copies)
            for number, spheres in enumerate(self.scene.spheres):
                self._show_spheres(f"/spheres{number}", spheres)

    def close(self) -> None:
        """Ends the server."""
        self.server.stop()

    def _look(self):
        """The camera and the sun of the scene; viser's own lights bleach colours."""
        view, camera = self.scene.view, self.server.initial_camera
        camera.position, camera.look_at = tuple(view["eye"]), tuple(view["target"])
        camera.fov = float(np.radians(view["fov"]))
        up = np.asarray(self.scene.up, float)
        sun = np.asarray(self.scene.sun[0] if self.scene.sun else up + [0.4, 0.2, 0.5], float)
        shown = self.server.scene
        shown.configure_default_lights(enabled=False)
        shown.configure_environment_map(environment_intensity=0.15)
        shown.add_light_directional("/sun", intensity=1.6, position=tuple(map(float, 10.0 * sun)))
        shown.add_light_ambient("/sky", intensity=0.9)

    def _show_mesh(self, name, mesh, copies):
        points, maps = mesh.points.numpy(), copies.transforms
        faces = mesh.indices.numpy().reshape(-1, 3)
        if self._share < 1.0:
            if mesh not in self._kept:
                self._kept[mesh] = clustered(points, faces, self._share * len(faces))
            kept, faces = self._kept[mesh]
            points = points[kept]
        count = len(maps)
        moved = np.einsum("nij,kj->nki", maps[:, :3, :3], points) + maps[:, None, :3, 3]
        rows = (faces[None] + (len(points) * np.arange(count))[:, None, None]).reshape(-1, 3)
        self.server.scene.add_mesh_simple(
            name,
            moved.reshape(-1, 3).astype(np.float32),
            rows.astype(np.uint32),
            color=self._color(copies.material),
            flat_shading=not mesh.smooth,
        )

    def _show_spheres(self, name, spheres):
        rows = spheres.rows
        tints = np.ones((len(rows), 3)) if spheres.colors is None else spheres.colors
        colors = np.clip(tints * np.array(self._color(spheres.material)), 0, 255).astype(np.uint8)
        if len(rows) > _BALLS:
            size = float(2.0 * np.median(rows[:, 3]))
            self.server.scene.add_point_cloud(
                name, rows[:, :3], colors, point_size=size, point_shape="circle"
            )
            return
        points, faces = _ball()
        turns = np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (len(rows), 1))
        self.server.scene.add_batched_meshes_simple(
            name,
            points,
            faces,
            batched_wxyzs=turns,
            batched_positions=rows[:, :3],
            batched_scales=rows[:, 3],
            batched_colors=colors,
            flat_shading=False,
        )

    def _color(self, number):
        row = self.scene.materials[number][0]
        color = np.clip(row["color"] + row["emission"], 0.0, 1.0)
        return tuple(int(round(255.0 * c ** (1.0 / 2.2))) for c in color.tolist())


def _ball(rings=8, sides=16):
    """A unit sphere of triangles."""
    height = np.linspace(0.0, np.pi, rings + 1)
    turn = np.arange(sides) * (2.0 * np.pi / sides)
    height, turn = np.meshgrid(height, turn, indexing="ij")
    flat = np.sin(height)
    points = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.cos(height)], -1)
    a = (np.arange(rings)[:, None] * sides + np.arange(sides)).reshape(-1)
    b = (np.arange(rings)[:, None] * sides + (np.arange(sides) + 1) % sides).reshape(-1)
    faces = np.stack([a, a + sides, b + sides, a, b + sides, b], 1).reshape(-1, 3)
    return points.reshape(-1, 3).astype(np.float32), faces.astype(np.uint32)
