"""Public names that are made when first asked for: builtins and submodules."""

from __future__ import annotations

import importlib
import sys

from warp._src.language import namespace
from warp._src.language.builtins import names as builtin_names

_SUBMODULES = (
    *("autograd", "build_experimental", "fem", "geometry", "optim", "render", "sparse", "types"),
    "utils",
)
# Names that few programs use, by the module that holds each.
_RARE = {
    name: home
    for home, held in (
        ("kernels.manifest", ("Manifest", "KernelManifest", "manifest")),
        ("devices.diagnostics", ("print_diagnostics",)),
        (
            "arrays.fabric",
            ("fabricarray", "fabricarrayarray", "indexedfabricarray", "indexedfabricarrayarray"),
        ),
        ("kernels.tiled", ("launch_tiled",)),
        (
            "textures.texture",
            (
                *("Texture", "Texture1D", "Texture2D", "Texture3D"),
                *("TextureAddressMode", "TextureFilterMode"),
            ),
        ),
        ("textures.sampling", ("texture_sample",)),
        ("geometry.bvh", ("Bvh", "is_cubql_available")),
        ("geometry.grid", ("HashGrid",)),
        ("geometry.mesh", ("Mesh",)),
        ("geometry.volumes.volume", ("Volume",)),
        ("utils.transforms", ("transform_expand",)),
        ("logger", ("Logger", "ScopedLogLevel", "ScopedLogger", "get_logger", "set_logger")),
        (
            "devices.timing",
            (
                *("TIMING_ALL", "TIMING_GRAPH", "TIMING_KERNEL", "TIMING_KERNEL_BUILTIN"),
                *("TIMING_MEMCPY", "TIMING_MEMSET", "TimingResult", "timing_begin", "timing_end"),
                *("timing_print", "cuda_profiler_start", "cuda_profiler_stop"),
                "ScopedCudaProfiler",
            ),
        ),
    )
    for name in held
}
# Written in the kernel language.
LIBRARY_NAMES = (
    *("dense_chol", "dense_chol_batched", "dense_gemm", "dense_gemm_batched", "dense_solve"),
    *("dense_solve_batched", "dense_subs"),
    *(
        "curlnoise",
        "quat_between_vectors",
        "quat_from_euler",
        "quat_to_euler",
        "spatial_adjoint",
        "spatial_bottom",
    ),
    *("spatial_cross", "spatial_cross_dual", "spatial_dot", "spatial_top", "transform_twist"),
    *("transform_wrench", "velocity_at_point"),
)
# Geometry queries of kernels, by the module of warp._src.geometry that is loaded for each.
_GEOMETRY_QUERIES = {
    name: module
    for module, names in {
        "grid_queries": (
            *("HashGridQuery", "hash_grid_point_id", "hash_grid_query", "hash_grid_query_next"),
        ),
        "tree_queries": (
            *("BvhQuery", "MeshQuery", "MeshQueryAABB", "bvh_query_aabb", "bvh_query_capsule"),
            *("bvh_query_next", "bvh_query_ray", "bvh_query_sphere", "mesh_query_aabb"),
            *("mesh_query_aabb_next", "mesh_query_next", "mesh_query_sphere"),
        ),
        "mesh_queries": (
            *("MeshQueryPoint", "MeshQueryRay", "mesh_eval_face_normal", "mesh_eval_position"),
            *("mesh_eval_velocity", "mesh_get_bvh", "mesh_get_index", "mesh_get_point"),
            *("mesh_get_velocity", "mesh_query_point", "mesh_query_point_no_sign"),
            *("mesh_query_ray", "mesh_query_ray_anyhit"),
        ),
        "mesh_signs": (
            *("bvh_get_group_root", "mesh_get", "mesh_get_group_root"),
            *("mesh_query_furthest_point_no_sign", "mesh_query_point_sign_normal"),
            *("mesh_query_point_sign_parity", "mesh_query_point_sign_winding_number"),
            *("mesh_query_ray_count_intersections", "mesh_sdf"),
        ),
        "tile_queries": (
            *("BvhQueryTiled", "MeshQueryAABBTiled", "bvh_query_aabb_tiled"),
            *("bvh_query_next_tiled", "bvh_query_ray_tiled", "mesh_query_aabb_next_tiled"),
            *("mesh_query_aabb_tiled", "tile_bvh_query_aabb", "tile_bvh_query_next"),
            *("tile_bvh_query_ray", "tile_mesh_query_aabb", "tile_mesh_query_aabb_next"),
            *("tile_query_valid",),
        ),
        "proximity": (*("closest_point_edge_edge", "intersect_tri_tri"),),
    }.items()
    for name in names
}
_VOLUME_QUERIES = frozenset(
    (
        *("volume_index_to_world", "volume_index_to_world_dir", "volume_lookup"),
        *("volume_lookup_f", "volume_lookup_i", "volume_lookup_index", "volume_lookup_v"),
        *("volume_sample", "volume_sample_f", "volume_sample_grad", "volume_sample_grad_f"),
        *("volume_sample_grad_index", "volume_sample_i", "volume_sample_index"),
        *("volume_sample_local", "volume_sample_v", "volume_sample_world", "volume_store"),
        *("volume_store_f", "volume_store_i", "volume_store_v", "volume_transform"),
        *("volume_transform_inv", "volume_voxel_count", "volume_world_to_index"),
        "volume_world_to_index_dir",
    )
)


def _find_geometry(name: str):
    """The geometry query of a name, or None."""
    if name == "MarchingCubes":
        return importlib.import_module("warp.geometry").IsoSurfaceMarchingCubes
    if module := _GEOMETRY_QUERIES.get(name):
        queries = importlib.import_module(f"warp._src.geometry.{module}")
        return queries.FUNCTIONS.get(name) or queries.TYPES[name]
    if name in _VOLUME_QUERIES:
        return importlib.import_module("warp._src.geometry.volumes.queries").FUNCTIONS[name]
    return None


def find(name: str):
    """The value of `warp.<name>`, for names that the package does not hold itself.

    Raises:
        AttributeError: there is no such name.
    """
    if name in _SUBMODULES:
        return importlib.import_module(f"warp.{name}")
    if name in _RARE:
        found = getattr(importlib.import_module(f"warp._src.{_RARE[name]}"), name)
        # Found without this function from now on, as `launch_tiled` is in loops.
        vars(sys.modules["warp"])[name] = found
        return found
    if name == "sym_fn3":
        from warp._src.language.symmetric import sym_fn3

        return sym_fn3
    found = None if name.startswith("_") else namespace.find(name)
    if name in LIBRARY_NAMES:
        from warp._src.language.library import LIBRARY

        found = LIBRARY[name]
    if found is None:
        found = _find_geometry(name)
    if found is None and not name.startswith("_"):
        found = importlib.import_module("warp._src.absent").find(name)
    if found is None:
        raise AttributeError(f"module 'warp' has no attribute '{name}'")
    return found


def names(held) -> list[str]:
    """All public names."""
    public = {name for name in held if not name.startswith("_")}
    lazy = {*_SUBMODULES, *LIBRARY_NAMES, *_RARE, *_GEOMETRY_QUERIES}
    lazy |= _VOLUME_QUERIES | {"MarchingCubes"}
    return sorted(public | set(builtin_names()) | lazy)
