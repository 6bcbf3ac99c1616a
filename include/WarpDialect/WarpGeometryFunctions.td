//===- WarpGeometryFunctions.td - Geometry queries -----------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions of the kernel language that the package has under `warp`. Overloads
// are Python signatures; a variable that the function assigns is a parameter of
// its type.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_GEOMETRY_FUNCTIONS_TD
#define WARP_GEOMETRY_FUNCTIONS_TD

include "WarpBuiltinBase.td"

let module = "geometry.mesh_queries", group = "Meshes",
    handle = "Mesh" in {
def : Warp_LibraryFunction<"mesh_query_point",
    ["(id: uint64, point: vec3f, max_dist: float) -> MeshQueryPoint",
     "(id: uint64, point: vec3f, max_dist: float, inside: float, face: int, "
     "bary_u: float, bary_v: float) -> bool"],
    "closest point of a mesh that is nearer than `max_dist`, and the side, "
    "by rays along the three axes. With variables for the results it assigns "
    "them if there is such a point">;
def : Warp_LibraryFunction<"mesh_query_point_no_sign",
    ["(id: uint64, point: vec3f, max_dist: float) -> MeshQueryPoint",
     "(id: uint64, point: vec3f, max_dist: float, face: int, bary_u: float, "
     "bary_v: float) -> bool"],
    "closest point of a mesh that is nearer than `max_dist`">;
def : Warp_LibraryFunction<"mesh_query_point_sign_normal",
    ["(id: uint64, point: vec3f, max_dist: float, epsilon: float = 0.001) -> "
     "MeshQueryPoint",
     "(id: uint64, point: vec3f, max_dist: float, inside: float, face: int, "
     "bary_u: float, bary_v: float, epsilon: float = 0.001) -> bool"],
    "closest point of a mesh that is nearer than `max_dist`, and the side by "
    "normals; corners closer than `epsilon` times the longest edge there are "
    "one">;
def : Warp_LibraryFunction<"mesh_query_furthest_point_no_sign",
    ["(id: uint64, point: vec3f, min_dist: float) -> MeshQueryPoint",
     "(id: uint64, point: vec3f, min_dist: float, face: int, bary_u: float, "
     "bary_v: float) -> bool"],
    "corner of a mesh that is furthest, if it is further than `min_dist`">;
def : Warp_LibraryFunction<"mesh_query_ray",
    ["(id: uint64, start: vec3f, dir: vec3f, max_t: float, root: int = -1) "
     "-> MeshQueryRay",
     "(id: uint64, start: vec3f, dir: vec3f, max_t: float, t: float, bary_u: "
     "float, bary_v: float, sign: float, normal: vec3f, face: int, root: int "
     "= -1) -> bool"],
    "first intersection of a ray with a mesh, at 0 <= t < max_t; back faces "
    "count">;
def : Warp_LibraryFunction<"mesh_query_ray_anyhit",
    ["(id: uint64, start: vec3f, dir: vec3f, max_t: float, root: int = -1) "
     "-> bool"],
    "true if a ray meets a mesh at 0 <= t < max_t">;
def : Warp_LibraryFunction<"mesh_eval_position",
    ["(id: uint64, face: int, u: float, v: float) -> vec3f"],
    "position of a point of a face; zero if there is no such face">;
def : Warp_LibraryFunction<"mesh_eval_velocity",
    ["(id: uint64, face: int, u: float, v: float) -> vec3f"],
    "velocity of a point of a face; zero if there is no such face, or no "
    "velocities">;
def : Warp_LibraryFunction<"mesh_eval_face_normal",
    ["(id: uint64, face: int) -> vec3f"],
    "unit normal of a face, on the side from which its corners go "
    "counter-clockwise">;
def : Warp_LibraryFunction<"mesh_get_point",
    ["(id: uint64, index: int) -> vec3f"],
    "position of the corner at a place of the mesh's indices">;
def : Warp_LibraryFunction<"mesh_get_velocity",
    ["(id: uint64, index: int) -> vec3f"],
    "velocity of the corner at a place of the mesh's indices; zero if it has "
    "none">;
def : Warp_LibraryFunction<"mesh_get_index",
    ["(id: uint64, index: int) -> int"],
    "element of the mesh's indices">;
def : Warp_LibraryFunction<"mesh_get_bvh", ["(id: uint64) -> uint64"],
    "hierarchy over the faces of a mesh, for `bvh_query_*`">;
}

let module = "geometry.mesh_signs", group = "Meshes",
    handle = "Mesh" in {
def : Warp_LibraryFunction<"mesh_query_point_sign_winding_number",
    ["(id: uint64, point: vec3f, max_dist: float, accuracy: float = 2.0, "
     "threshold: float = 0.5) -> MeshQueryPoint",
     "(id: uint64, point: vec3f, max_dist: float, inside: float, face: int, "
     "bary_u: float, bary_v: float, accuracy: float = 2.0, threshold: float "
     "= 0.5) -> bool"],
    "closest point of a mesh that is nearer than `max_dist`, and the side by "
    "winding numbers; inside is where they exceed `threshold`">;
def : Warp_LibraryFunction<"mesh_query_point_sign_parity",
    ["(id: uint64, point: vec3f, max_dist: float, n_sample: int = 1, "
     "perturbation_scale: float = 0.1) -> MeshQueryPoint",
     "(id: uint64, point: vec3f, max_dist: float, inside: float, face: int, "
     "bary_u: float, bary_v: float, n_sample: int = 1, perturbation_scale: "
     "float = 0.1) -> bool"],
    "closest point of a mesh that is nearer than `max_dist`, and the side by "
    "the parity of intersections of rays">;
def : Warp_LibraryFunction<"mesh_query_ray_count_intersections",
    ["(id: uint64, start: vec3f, dir: vec3f, root: int = -1) -> int"],
    "number of intersections of a ray with a mesh at t >= 0">;
def : Warp_LibraryFunction<"mesh_sdf",
    ["(id: uint64, point: vec3f, max_dist: float = ...) -> float"],
    "distance of a point to a mesh, negative inside; `max_dist` if it is no "
    "nearer">;
def : Warp_LibraryFunction<"mesh_get", ["(id: uint64) -> Any"],
    "arrays of a mesh: `points`, `velocities` and `indices`">;
def : Warp_LibraryFunction<"mesh_get_group_root",
    ["(id: uint64, group: int) -> int"],
    "node that holds the faces of a group, for queries with a `root`; -1 if "
    "there is none">;
}

let module = "geometry.tree_queries", group = "Meshes",
    handle = "Mesh" in {
def : Warp_LibraryFunction<"mesh_query_aabb",
    ["(id: uint64, low: vec3f, high: vec3f) -> MeshQueryAABB"],
    "faces of a mesh whose bounds overlap a box, borders included">;
def : Warp_LibraryFunction<"mesh_query_sphere",
    ["(id: uint64, center: vec3f, radius: float) -> MeshQuery"],
    "faces of a mesh within a distance of a point">;
def : Warp_LibraryFunction<"mesh_query_next",
    ["(query: MeshQuery, index: int) -> bool"],
    "assigns the next face of a query to `index`; false when there is none">;
def : Warp_LibraryFunction<"mesh_query_aabb_next",
    ["(query: MeshQuery, index: int) -> bool"],
    "`mesh_query_next`">;
}

let module = "geometry.tree_queries", group = "Bounding volume hierarchies",
    handle = "Bvh" in {
def : Warp_LibraryFunction<"bvh_query_aabb",
    ["(id: uint64, low: vec3f, high: vec3f, root: int = -1) -> BvhQuery"],
    "boxes of a Bvh that overlap a box, borders included">;
def : Warp_LibraryFunction<"bvh_query_sphere",
    ["(id: uint64, center: vec3f, radius: float, root: int = -1) -> BvhQuery"],
    "boxes of a Bvh that overlap a ball, borders included">;
def : Warp_LibraryFunction<"bvh_query_ray",
    ["(id: uint64, start: vec3f, dir: vec3f, root: int = -1) -> BvhQuery"],
    "boxes of a Bvh that a ray meets, in no order">;
def : Warp_LibraryFunction<"bvh_query_capsule",
    ["(id: uint64, start: vec3f, dir: vec3f, radius: float, root: int = -1) "
     "-> BvhQuery"],
    "boxes of a Bvh that, grown by a radius, a ray meets, in no order">;
def : Warp_LibraryFunction<"bvh_query_next",
    ["(query: BvhQuery, index: int, max_dist: float = ...) -> bool"],
    "assigns the next box of a query to `index`; false when there is none. "
    "`max_dist` is a ray's end, in units of its direction">;
}

let module = "geometry.mesh_signs", group = "Bounding volume hierarchies",
    handle = "Bvh" in {
def : Warp_LibraryFunction<"bvh_get_group_root",
    ["(id: uint64, group: int) -> int"],
    "node that holds the boxes of a group, for queries with a `root`; -1 if "
    "there is none">;
}

let module = "geometry.tile_queries", group = "Queries of a block" in {
let handle = "Bvh" in {
def : Warp_LibraryFunction<"tile_bvh_query_aabb",
    ["(id: uint64, low: vec3f, high: vec3f) -> BvhQueryTiled"],
    "boxes of a Bvh that overlap a box, borders included, found by a block "
    "together. All threads of the block give the same arguments">;
def : Warp_LibraryFunction<"tile_bvh_query_ray",
    ["(id: uint64, start: vec3f, dir: vec3f) -> BvhQueryTiled"],
    "boxes of a Bvh that a ray meets, in no order, found by a block "
    "together. All threads of the block give the same arguments">;
def : Warp_LibraryFunction<"tile_bvh_query_next",
    ["(query: BvhQueryTiled) -> Any"],
    "next boxes, a tile with one for each thread of the block; -1 where it "
    "has none left">;
def : Warp_LibraryFunction<"bvh_query_aabb_tiled",
    ["(id: uint64, low: vec3f, high: vec3f) -> BvhQueryTiled"],
    "`tile_bvh_query_aabb`, by its name of before 1.18">;
def : Warp_LibraryFunction<"bvh_query_ray_tiled",
    ["(id: uint64, start: vec3f, dir: vec3f) -> BvhQueryTiled"],
    "`tile_bvh_query_ray`, by its name of before 1.18">;
def : Warp_LibraryFunction<"bvh_query_next_tiled",
    ["(query: BvhQueryTiled) -> Any"],
    "`tile_bvh_query_next`, by its name of before 1.18">;
}
let handle = "Mesh" in {
def : Warp_LibraryFunction<"tile_mesh_query_aabb",
    ["(id: uint64, low: vec3f, high: vec3f) -> MeshQueryAABBTiled"],
    "faces of a mesh whose bounds overlap a box, borders included, found by "
    "a block together. All threads of the block give the same arguments">;
def : Warp_LibraryFunction<"tile_mesh_query_aabb_next",
    ["(query: MeshQueryAABBTiled) -> Any"],
    "next faces, a tile with one for each thread of the block; -1 where it "
    "has none left">;
def : Warp_LibraryFunction<"mesh_query_aabb_tiled",
    ["(id: uint64, low: vec3f, high: vec3f) -> MeshQueryAABBTiled"],
    "`tile_mesh_query_aabb`, by its name of before 1.18">;
def : Warp_LibraryFunction<"mesh_query_aabb_next_tiled",
    ["(query: MeshQueryAABBTiled) -> Any"],
    "`tile_mesh_query_aabb_next`, by its name of before 1.18">;
}
def : Warp_LibraryFunction<"tile_query_valid",
    ["(query: BvhQueryTiled | MeshQueryAABBTiled) -> bool"],
    "true at first, and after a tile in which a thread had a result: the "
    "block is to ask on">;
}

let module = "geometry.grid_queries", group = "Hash grids",
    handle = "HashGrid" in {
def : Warp_LibraryFunction<"hash_grid_query",
    ["(id: uint64, point: Any, max_dist: Any) -> HashGridQuery",
     "(id: uint64, point: Any, max_dist: Any, group: int) -> Any"],
    "points of the cells of a grid around a point, all of them or those of a "
    "group; distances are the caller's to check">;
def : Warp_LibraryFunction<"hash_grid_query_next",
    ["(query: Any, index: int) -> bool"],
    "assigns the next point of a query to `index`; false when there is none">;
def : Warp_LibraryFunction<"hash_grid_point_id",
    ["(id: uint64, index: int) -> int"],
    "point at a place of the grid's order, in which neighbours are close; -1 "
    "beyond it">;
}

let module = "geometry.proximity", group = "Triangles and edges" in {
def : Warp_LibraryFunction<"closest_point_edge_edge",
    ["(p1: vec3f, q1: vec3f, p2: vec3f, q2: vec3f, epsilon: float) -> vec3f"],
    "(s, t, distance) where two edges are closest: at p1 + s (q1 - p1) and "
    "p2 + t (q2 - p2)">;
def : Warp_LibraryFunction<"intersect_tri_tri",
    ["(v0: vec3d, v1: vec3d, v2: vec3d, u0: vec3d, u1: vec3d, u2: vec3d) -> "
     "int",
     "(v0: vec3f, v1: vec3f, v2: vec3f, u0: vec3f, u1: vec3f, u2: vec3f) -> "
     "int"],
    "1 if two triangles share a point, else 0; triangles of one plane may, "
    "too">;
}

let module = "geometry.volumes.queries", group = "Volumes",
    handle = "Volume" in {
def : Warp_LibraryFunction<"volume_sample",
    ["(id: uint64, uvw: vec3f, sampling_mode: int, dtype: Any) -> Any"],
    "value at a point of index space, of voxels of type `dtype`">;
def : Warp_LibraryFunction<"volume_sample_f",
    ["(id: uint64, uvw: vec3f, sampling_mode: int) -> float"],
    "float32 at a point of index space">;
def : Warp_LibraryFunction<"volume_sample_v",
    ["(id: uint64, uvw: vec3f, sampling_mode: int) -> vec3f"],
    "vec3f at a point of index space">;
def : Warp_LibraryFunction<"volume_sample_i",
    ["(id: uint64, uvw: vec3f) -> int"],
    "int32 of the voxel closest to a point of index space">;
def : Warp_LibraryFunction<"volume_sample_local",
    ["(id: uint64, uvw: vec3f, sampling_mode: int) -> float"],
    "`volume_sample_f`">;
def : Warp_LibraryFunction<"volume_sample_world",
    ["(id: uint64, xyz: vec3f, sampling_mode: int) -> float"],
    "float32 at a point of the world">;
def : Warp_LibraryFunction<"volume_sample_grad",
    ["(id: uint64, uvw: vec3f, sampling_mode: int, grad: Any, dtype: Any) -> "
     "Any"],
    "value at a point of index space, of voxels of type `dtype`, and its "
    "gradient in `grad`">;
def : Warp_LibraryFunction<"volume_sample_grad_f",
    ["(id: uint64, uvw: vec3f, sampling_mode: int, grad: vec3f) -> float"],
    "float32 at a point of index space, and its gradient in `grad`">;
def : Warp_LibraryFunction<"volume_sample_index",
    ["(id: uint64, uvw: vec3f, sampling_mode: int, voxel_data: array, "
     "background: Any) -> Any"],
    "value at a point of index space, of voxels whose values are in an "
    "array, by their numbers">;
def : Warp_LibraryFunction<"volume_sample_grad_index",
    ["(id: uint64, uvw: vec3f, sampling_mode: int, voxel_data: array, "
     "background: Any, grad: Any) -> Any"],
    "`volume_sample_index`, and the gradient in `grad`">;
def : Warp_LibraryFunction<"volume_lookup",
    ["(id: uint64, i: int, j: int, k: int, dtype: Any) -> Any",
     "(id: uint64, ijk: vec3i) -> float"],
    "value of a voxel, of type `dtype`; the background where there is none">;
def : Warp_LibraryFunction<"volume_lookup_f",
    ["(id: uint64, i: int, j: int, k: int) -> float"],
    "float32 of a voxel">;
def : Warp_LibraryFunction<"volume_lookup_v",
    ["(id: uint64, i: int, j: int, k: int) -> vec3f"],
    "vec3f of a voxel">;
def : Warp_LibraryFunction<"volume_lookup_i",
    ["(id: uint64, i: int, j: int, k: int) -> int"],
    "int32 of a voxel">;
def : Warp_LibraryFunction<"volume_lookup_index",
    ["(id: uint64, i: int, j: int, k: int) -> int"],
    "number of a voxel, from 0; -1 if it has none">;
def : Warp_LibraryFunction<"volume_store",
    ["(id: uint64, i: int, j: int, k: int, given: Any) -> None"],
    "stores the value of a voxel, if there is one">;
def : Warp_LibraryFunction<"volume_store_f",
    ["(id: uint64, i: int, j: int, k: int, given: float) -> None"],
    "stores a float32">;
def : Warp_LibraryFunction<"volume_store_v",
    ["(id: uint64, i: int, j: int, k: int, given: vec3f) -> None"],
    "stores a vec3f">;
def : Warp_LibraryFunction<"volume_store_i",
    ["(id: uint64, i: int, j: int, k: int, given: int) -> None"],
    "stores an int32">;
def : Warp_LibraryFunction<"volume_voxel_count", ["(id: uint64) -> int"],
    "how many numbers of voxels there are, for `volume_sample_index`">;
def : Warp_LibraryFunction<"volume_index_to_world",
    ["(id: uint64, uvw: vec3d) -> vec3d",
     "(id: uint64, uvw: vec3f) -> vec3f"],
    "point of the world at a place in index space">;
def : Warp_LibraryFunction<"volume_world_to_index",
    ["(id: uint64, xyz: vec3d) -> vec3d",
     "(id: uint64, xyz: vec3f) -> vec3f"],
    "place in index space of a point of the world">;
def : Warp_LibraryFunction<"volume_index_to_world_dir",
    ["(id: uint64, uvw: vec3d) -> vec3d",
     "(id: uint64, uvw: vec3f) -> vec3f"],
    "direction in the world of one in index space, with its length there">;
def : Warp_LibraryFunction<"volume_world_to_index_dir",
    ["(id: uint64, xyz: vec3d) -> vec3d",
     "(id: uint64, xyz: vec3f) -> vec3f"],
    "direction in index space of one in the world, with its length there">;
def : Warp_LibraryFunction<"volume_transform",
    ["(id: uint64, uvw: vec3d) -> vec3d",
     "(id: uint64, uvw: vec3f) -> vec3f"],
    "`volume_index_to_world`">;
def : Warp_LibraryFunction<"volume_transform_inv",
    ["(id: uint64, xyz: vec3d) -> vec3d",
     "(id: uint64, xyz: vec3f) -> vec3f"],
    "`volume_world_to_index`">;
}

#endif // WARP_GEOMETRY_FUNCTIONS_TD
