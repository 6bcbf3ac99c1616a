"""Records of a scene as kernels read them, built when something has changed."""

import numpy as np

import warp as wp
from warp._src.render.tracing.parts import bound_spheres
from warp._src.render.tracing.records import (
    Image,
    Instance,
    LevelSet,
    Material,
    Medium,
    Shape,
    World,
)


def world_of(scene):
    """The world of a scene; it keeps what its kernels read alive."""
    world = World()
    extent = [_place_meshes(scene, world), _place_spheres(scene, world)]
    device = scene.device
    world.materials = _records(scene.materials, Material, device)
    world.media = _records(scene.media, Medium, device)
    world.medium_count = len(scene.media)
    world.level_sets = _records(scene.level_sets, LevelSet, device)
    world.level_set_count = len(scene.level_sets)
    extent += [row[name] for row in scene.level_sets for name in ("low", "high")]
    _place_images(scene, world)
    world.sky = scene.sky
    east, north, up = scene._axes()
    world.east, world.north, world.up = wp.vec3(*east), wp.vec3(*north), wp.vec3(*up)
    world.sun_cosine = 2.0
    if scene.sun is not None:
        direction, radiance, world.sun_cosine = scene.sun
        world.sun, world.sun_radiance = wp.vec3(*direction), wp.vec3(*radiance)
    corners = np.concatenate([np.asarray(part).reshape(-1, 3) for part in extent])
    # Rays start this far off the surface that they leave: some float32 roundings of positions.
    # Only what is close to the eye need be as precise as that.
    size = np.abs(corners).max() if len(corners) else 1.0
    world.reach = float(min(max(4.0e-6 * size, 1.0e-6), 2.0e-4 * max(size, 1.0)))
    return world


def _records(rows, struct, device):
    if not rows:
        return wp.zeros(1, dtype=struct, device=device)
    # NumPy's concatenate would drop the padding of a record.
    out, start = np.zeros(sum(map(len, rows)), struct.numpy_dtype()), 0
    for row in rows:
        out[start : start + len(row)] = row
        start += len(row)
    return wp.array(out, dtype=struct, device=device)


def _place_meshes(scene, world):
    device, shapes, parts = scene.device, [], {"normals": [], "uvs": [], "colors": []}
    sizes = dict.fromkeys(parts, 0)
    for mesh in scene.meshes:
        row = np.zeros(1, Shape.numpy_dtype())
        row["mesh"] = mesh.mesh.id
        normals = mesh.normals() if mesh.smooth else None
        for name, values in (("normals", normals), ("uvs", mesh.uvs), ("colors", mesh.colors)):
            row[name] = -1 if values is None else sizes[name]
            if values is not None:
                parts[name].append(values)
                sizes[name] += len(values)
        shapes.append(row)
    world.shapes = _records(shapes, Shape, device)
    world.normals = _joined(parts["normals"], wp.vec3, device)
    world.uvs = _joined(parts["uvs"], wp.vec2, device)
    world.colors = _joined(parts["colors"], wp.vec3, device)
    numbers = {id(mesh): number for number, mesh in enumerate(scene.meshes)}
    placed = [copies.rows(numbers[id(copies.mesh)]) for copies in scene.instances]
    world.instances = _records([rows for rows, _, _ in placed], Instance, device)
    world.instance_count = sum(len(rows) for rows, _, _ in placed)
    if not placed:
        return np.zeros((0, 3))
    low = np.concatenate([low for _, low, _ in placed])
    high = np.concatenate([high for _, _, high in placed])
    boxes = [wp.array(v.astype(np.float32), dtype=wp.vec3, device=device) for v in (low, high)]
    scene._instance_tree = wp.Bvh(*boxes)
    world.instance_tree = scene._instance_tree.id
    return np.concatenate([low, high])


def _joined(parts, dtype, device):
    if not parts:
        return wp.zeros(1, dtype=dtype, device=device)
    out = wp.empty(sum(map(len, parts)), dtype=dtype, device=device)
    start = 0
    for part in parts:
        wp.copy(out, part, dest_offset=start, count=len(part))
        start += len(part)
    return out


def _place_spheres(scene, world):
    device = scene.device
    rows = [spheres.rows for spheres in scene.spheres]
    numbers = [np.full(len(s.rows), s.material, np.int32) for s in scene.spheres]
    colors = [np.ones((len(s.rows), 3)) if s.colors is None else s.colors for s in scene.spheres]
    all_rows = np.concatenate(rows) if rows else np.zeros((0, 4), np.float32)
    materials = np.concatenate(numbers) if rows else np.zeros(0, np.int32)
    tints = np.concatenate(colors).astype(np.float32) if rows else np.zeros((0, 3), np.float32)
    shining = np.array([row["emission"].sum() > 0.0 for row in scene.materials] or [False])
    lamps = np.flatnonzero(shining[materials]) if rows else np.zeros(0)
    world.spheres = wp.array(all_rows, dtype=wp.vec4, device=device)
    world.sphere_colors = wp.array(tints, dtype=wp.vec3, device=device)
    world.sphere_materials = wp.array(materials, dtype=int, device=device)
    world.lamps = wp.array(lamps.astype(np.int32), dtype=int, device=device)
    world.sphere_count, world.lamp_count = len(all_rows), len(lamps)
    if not rows:
        return np.zeros((0, 3))
    boxes = [wp.empty(len(all_rows), dtype=wp.vec3, device=device) for _ in range(2)]
    wp.launch(bound_spheres, len(all_rows), [world.spheres], boxes, device=device)
    scene._sphere_tree = wp.Bvh(*boxes)
    world.sphere_tree = scene._sphere_tree.id
    return np.concatenate([all_rows[:, :3] - all_rows[:, 3:], all_rows[:, :3] + all_rows[:, 3:]])


def _place_images(scene, world):
    rows, start = [], 0
    for image in scene.images:
        row = np.zeros(1, Image.numpy_dtype())
        row["start"], row["height"], row["width"] = start, image.shape[0], image.shape[1]
        start += image.shape[0] * image.shape[1]
        rows.append(row)
    world.images = _records(rows, Image, scene.device)
    texels = [image.reshape(-1, 3) for image in scene.images] or [np.zeros((1, 3), np.float32)]
    world.texels = wp.array(np.concatenate(texels), dtype=wp.vec3, device=scene.device)
