//===- Functions.td - Device functions and handle kinds ------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_FUNCTIONS_TD
#define WARP_FUNCTIONS_TD

include "FunctionBase.td"

//===----------------------------------------------------------------------===//
// Handle kinds
//===----------------------------------------------------------------------===//

def HashGrid : HandleKind<1, [
  Word<"cells_xy">, Word<"cells_z">, Word<"inverse">,
  ReadOnly<Array<"starts", 4>>, ReadOnly<Array<"order", 4>>, Array<"groups", 4>
]>;

/// The end of the slot of a hierarchy: what only some of them have.
defvar treeExtras = [Pointer<"moments">, Pointer<"group_roots">,
                     Word<"tree_counts">];
def Bvh : HandleKind<2, [
  Pointer<"nodes">, Pointer<"blocks">, Word<"scale">,
  SlotField<"unused", 21>
] # treeExtras>;
def Mesh : HandleKind<3, [
  Pointer<"nodes">, Pointer<"blocks">, Word<"scale">,
  Array<"points", 12>, Array<"velocities", 12>, Array<"indices", 4>
] # treeExtras, [Bvh]>;

def Volume : HandleKind<4, [
  ReadOnly<Pointer<"grid">>, Pointer<"root">, Pointer<"leaves">, Word<"type">,
  Word<"voxels">, Word<"gradient">, SlotField<"offsets", 5>,
  Pointer<"leaves_end">, Pointer<"numbers">, SlotField<"box", 3>
]>;

//===----------------------------------------------------------------------===//
// Handles and memory of a thread
//===----------------------------------------------------------------------===//

/// Calls with one number give the address of the same memory, which is the
/// thread's own, though its operands are the same everywhere.
def : DeviceFunction<"thread_memory", "(number: i32, bytes: i32) -> u64",
    [Expanded]>;
/// 1 in derivatives and in what they repeat of a kernel, 0 elsewhere. For
/// values that only derivatives have to reach in a slower way; what a kernel
/// computes must not depend on it.
def : DeviceFunction<"is_differentiated", "() -> i32", [Expanded]>;
/// The slot of a handle, or one with nothing.
def : DeviceFunction<"slot", "(id: u64, kind: i32) -> u64",
    [FindsSlot, AssembledShort]>;

//===----------------------------------------------------------------------===//
// Meshes and hierarchies
//===----------------------------------------------------------------------===//

/// A point of a face, by the weights of its first and second corner; face -1
/// where there is none.
def ClosestPoint : ResultStruct<"face: i32, u: f32, v: f32">;
/// The same and the side by normals.
def SignedPoint : ResultStruct<"point: ClosestPoint, sign: f32">;
def RayHit : ResultStruct<"face: i32, u: f32, v: f32, t: f32">;
/// The primitive of an iterator or -1, then its cursor.
def NextOverlap : ResultStruct<
    "primitive: i32, node: i32, level: i32, block: i32, left: i32, "
    "lowTrail: u64, highTrail: u64">;
/// The cursor at which one thread's share of a query starts.
def OverlapShare : ResultStruct<
    "node: i32, level: i32, block: i32, left: i32, lowTrail: u64, "
    "highTrail: u64">;

def : DeviceFunction<"mesh_closest",
    "(mesh: handle<Mesh>, point: vec3f, max_dist: f32) -> ClosestPoint",
    [Registers<48>, Assembled]>;
def : DeviceFunction<"mesh_furthest",
    "(mesh: handle<Mesh>, point: vec3f, min_dist: f32) -> ClosestPoint",
    [Registers<80>, Assembled]>;
/// Corners are one within `epsilon`.
def : DeviceFunction<"mesh_closest_signed",
    "(mesh: handle<Mesh>, point: vec3f, max_dist: f32, epsilon: f32) -> "
    "SignedPoint", [Registers<80>, Assembled]>;
/// -1 inside, 1 outside.
def : DeviceFunction<"mesh_side", "(mesh: handle<Mesh>, point: vec3f) -> f32",
    [Registers<80>, Assembled]>;
def : DeviceFunction<"mesh_ray",
    "(mesh: handle<Mesh>, start: vec3f, dir: vec3f, max_t: f32, root: i32) -> "
    "RayHit", [Registers<64>, Assembled]>;
def : DeviceFunction<"mesh_ray_any",
    "(mesh: handle<Mesh>, start: vec3f, dir: vec3f, max_t: f32, root: i32) -> "
    "i32", [Registers<64>, Assembled]>;
/// How often a ray crosses the surface.
def : DeviceFunction<"mesh_ray_count",
    "(mesh: handle<Mesh>, start: vec3f, dir: vec3f, root: i32) -> i32",
    [Registers<80>, Assembled]>;
def : DeviceFunction<"mesh_side_parity",
    "(mesh: handle<Mesh>, point: vec3f, rays: i32, spread: f32) -> f32",
    [Registers<80>, Assembled]>;
def : DeviceFunction<"mesh_side_winding",
    "(mesh: handle<Mesh>, point: vec3f, accuracy: f32, threshold: f32) -> f32",
    [Registers<80>, Assembled]>;
/// The node that holds a group, or -1.
def : DeviceFunction<"group_root", "(id: handle<Bvh>, group: i32) -> i32",
    [AssembledShort]>;
/// `shape` has two points and a radius.
def : DeviceFunction<"overlap_next",
    "(id: handle<Bvh>, shape: i32, first: vec3f, second: vec3f, radius: f32, "
    "limit: f32, node: i32, level: i32, block: i32, left: i32, lowTrail: u64, "
    "highTrail: u64) -> NextOverlap", [Assembled]>;
def : DeviceFunction<"overlap_share",
    "(id: handle<Bvh>, shape: i32, first: vec3f, second: vec3f, radius: f32, "
    "thread: i32, threads: i32) -> OverlapShare">;

//===----------------------------------------------------------------------===//
// Volumes and hash grids
//===----------------------------------------------------------------------===//

/// Corners of a cell, z fastest.
def CellPlaces : ResultStruct<"at: u64[8]">;
def CellIndices : ResultStruct<"index: i32[8]">;
/// The first cell and the number of cells along each axis.
def CellBox : ResultStruct<
    "x: i32, xCount: i32, y: i32, yCount: i32, z: i32, zCount: i32">;

/// The place of the value of a voxel (geometry/Volume.h).
def : DeviceFunction<"volume_voxel",
    "(id: handle<Volume>, voxel: vec3i) -> u64", [Lanes<1>]>;
/// The places of the corners of a cell in a grid of that type.
def : DeviceFunction<"volume_cell",
    "(id: handle<Volume>, type: i32, voxel: vec3i) -> CellPlaces", [Lanes<2>]>;
/// The address of the value of a leaf, or 0.
def : DeviceFunction<"volume_place",
    "(id: handle<Volume>, type: i32, voxel: vec3i) -> u64">;
/// The number of a voxel, or -1.
def : DeviceFunction<"volume_index",
    "(id: handle<Volume>, voxel: vec3i) -> i32", [Lanes<1>]>;
def : DeviceFunction<"volume_cell_index",
    "(id: handle<Volume>, voxel: vec3i) -> CellIndices", [Lanes<1>]>;
/// The cells of a grid around a point; `inverse` is cells per unit of length.
def : DeviceFunction<"grid_cells_f32",
    "(inverse: f32, cells: vec3i, point: vec3f, distance: f32) -> CellBox",
    [Lanes<4>]>;
def : DeviceFunction<"grid_cells_f64",
    "(inverse: f64, cells: vec3i, point: vec3d, distance: f64) -> CellBox",
    [Lanes<4>]>;

//===----------------------------------------------------------------------===//
// Predicates
//===----------------------------------------------------------------------===//

/// The orientation of three points of a plane, and of four points of space.
def : DeviceFunction<"orient2d", "(p: vec2d, q: vec2d, r: vec2d) -> i32">;
def : DeviceFunction<"orient3d",
    "(a: vec3d, b: vec3d, c: vec3d, d: vec3d) -> i32">;

include "TileFunctions.td"

#endif // WARP_FUNCTIONS_TD
