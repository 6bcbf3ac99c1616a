"""Scenes in files of other programs: glTF and others by trimesh, USD by usd-core."""

import os

import numpy as np

from warp._src.render.models import _trimesh, make_mesh
from warp._src.render.tracing.viewer import _ball

USD = (".usd", ".usda", ".usdc")


def save_model(scene, path) -> None:
    """Writes a scene; see `Scene.save_model`."""
    if not scene.meshes and not scene.spheres:
        raise ValueError("expects a scene with meshes or spheres, but it has none")
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if ending in USD:
        _save_usd(scene, os.fspath(path))
        return
    trimesh, _ = _trimesh(path)
    made = trimesh.Scene()
    for name, mesh, material, transforms in _parts(scene):
        row = scene.materials[material][0]
        look = trimesh.visual.material.PBRMaterial(
            baseColorFactor=[*np.clip(row["color"], 0.0, 1.0), 1.0 - 0.7 * row["transmission"]],
            metallicFactor=float(row["metallic"]),
            roughnessFactor=float(row["roughness"]),
            emissiveFactor=np.clip(row["emission"], 0.0, 1.0).tolist(),
            alphaMode="BLEND" if row["transmission"] > 0.0 else "OPAQUE",
        )
        part = make_mesh(trimesh, *mesh, material=look)
        for number, place in enumerate(transforms):
            made.add_geometry(part, node_name=f"{name}_{number}", geom_name=name, transform=place)
    made.export(os.fspath(path))


def _parts(scene):
    """Name, (points, indices, colors, uvs), material and transforms of every part."""
    for number, copies in enumerate(scene.instances):
        mesh = copies.mesh
        arrays = [mesh.points, mesh.indices, mesh.colors, mesh.uvs]
        yield f"mesh{number}", arrays, copies.material, copies.transforms
    points, faces = _ball(12, 24)
    for number, spheres in enumerate(scene.spheres):
        places = np.tile(np.eye(4), (len(spheres.rows), 1, 1))
        places[:, [0, 1, 2], [0, 1, 2]] = spheres.rows[:, 3:]
        places[:, :3, 3] = spheres.rows[:, :3]
        arrays = [points, faces.reshape(-1), None, None]
        yield f"spheres{number}", arrays, spheres.material, places


def _save_usd(scene, path):
    from warp._src.render.usd import load

    usd = load()
    from pxr import UsdLux, UsdShade

    stage = usd.Usd.Stage.CreateNew(path)
    if stage is None:
        raise OSError(f"cannot write '{path}'")
    root = usd.UsdGeom.Xform.Define(stage, "/root")
    stage.SetDefaultPrim(root.GetPrim())
    axis = usd.UsdGeom.Tokens.z if abs(scene.up[2]) > 0.9 else usd.UsdGeom.Tokens.y
    usd.UsdGeom.SetStageUpAxis(stage, axis)
    usd.UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    materials = [
        _usd_material(usd, UsdShade, stage, number, row[0])
        for number, row in enumerate(scene.materials)
    ]
    for name, mesh, material, transforms in _parts(scene):
        if name.startswith("spheres"):
            _usd_spheres(usd, UsdShade, stage, scene, name, materials[material])
            continue
        points, indices = (np.asarray(a.numpy()) for a in mesh[:2])
        for number, place in enumerate(transforms):
            prim = usd.UsdGeom.Mesh.Define(stage, f"/root/{name}_{number}")
            prim.CreatePointsAttr(usd.Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
            prim.CreateFaceVertexIndicesAttr(usd.Vt.IntArray.FromNumpy(indices))
            count = np.full(len(indices) // 3, 3, np.int32)
            prim.CreateFaceVertexCountsAttr(usd.Vt.IntArray.FromNumpy(count))
            prim.CreateSubdivisionSchemeAttr("none")
            prim.AddTransformOp().Set(usd.Gf.Matrix4d(place.T.tolist()))
            UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(materials[material])
    _usd_lights(usd, UsdLux, stage, scene)
    stage.Save()


def _usd_material(usd, shade, stage, number, row):
    material = shade.Material.Define(stage, f"/root/materials/m{number}")
    shader = shade.Shader.Define(stage, f"/root/materials/m{number}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    kinds = usd.Sdf.ValueTypeNames
    for name, kind, value in (
        ("diffuseColor", kinds.Color3f, usd.Gf.Vec3f(*row["color"].tolist())),
        ("emissiveColor", kinds.Color3f, usd.Gf.Vec3f(*row["emission"].tolist())),
        ("roughness", kinds.Float, float(row["roughness"])),
        ("metallic", kinds.Float, float(row["metallic"])),
        ("opacity", kinds.Float, 1.0 - float(row["transmission"])),
        ("ior", kinds.Float, float(row["ior"])),
    ):
        shader.CreateInput(name, kind).Set(value)
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return material


def _usd_spheres(usd, shade, stage, scene, name, material):
    spheres = scene.spheres[int(name.removeprefix("spheres"))]
    prim = usd.UsdGeom.Points.Define(stage, f"/root/{name}")
    prim.CreatePointsAttr(usd.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(spheres.rows[:, :3])))
    prim.CreateWidthsAttr(
        usd.Vt.FloatArray.FromNumpy(np.ascontiguousarray(2.0 * spheres.rows[:, 3]))
    )
    if spheres.colors is not None:
        color = scene.materials[spheres.material][0]["color"] * spheres.colors
        shown = prim.CreateDisplayColorPrimvar(usd.UsdGeom.Tokens.vertex)
        shown.Set(usd.Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(color, np.float32)))
    shade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def _usd_lights(usd, lux, stage, scene):
    dome = lux.DomeLight.Define(stage, "/root/sky")
    mean = scene.sky.numpy().reshape(-1, 3).mean(axis=0)
    dome.CreateColorAttr(usd.Gf.Vec3f(*mean.tolist()))
    dome.CreateIntensityAttr(1.0)
    if scene.sun is not None:
        direction, radiance, cosine = scene.sun
        sun = lux.DistantLight.Define(stage, "/root/sun")
        sun.CreateColorAttr(usd.Gf.Vec3f(*(radiance / max(radiance.max(), 1e-30)).tolist()))
        sun.CreateIntensityAttr(float(radiance.max()))
        sun.CreateAngleAttr(float(2.0 * np.degrees(np.arccos(cosine))))
        # A distant light shines along -z.
        turn = usd.Gf.Rotation(usd.Gf.Vec3d(0, 0, 1), usd.Gf.Vec3d(*direction.tolist()))
        sun.AddTransformOp().Set(usd.Gf.Matrix4d(turn, usd.Gf.Vec3d(0)))
    for number, spheres in enumerate(scene.spheres):
        emission = scene.materials[spheres.material][0]["emission"]
        if emission.max() > 0.0:
            for k, (x, y, z, radius) in enumerate(spheres.rows.tolist()):
                lamp = lux.SphereLight.Define(stage, f"/root/lamp{number}_{k}")
                lamp.CreateRadiusAttr(radius)
                lamp.CreateIntensityAttr(float(emission.max()))
                lamp.CreateColorAttr(usd.Gf.Vec3f(*(emission / emission.max()).tolist()))
                lamp.AddTranslateOp().Set(usd.Gf.Vec3d(x, y, z))
