//===- Overlaps.cpp - BVH overlap queries ---------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Exports.h"
#include "geometry/Shapes.h"

using namespace warp::geometry;

WARP_GEOMETRY warp_overlap_next(u64 id, i32 shape, f32 a, f32 b, f32 c, f32 d,
                                f32 e, f32 f, f32 g, f32 limit, i32 node,
                                i32 level, i32 block, i32 left, u64 lowTrail,
                                u64 highTrail, NextOverlap *result) {
  const f32 numbers[7] = {a, b, c, d, e, f, g};
  Cursor cursor{node, level, block, u32(left), lowTrail, highTrail, 0};
  auto next = [&]<class Block>(const Tree &tree, Block *) {
    if (level < 0)
      cursor.node = startOf(tree, node);
    // At the end, and not at the root of all when it is asked again.
    if (cursor.node < 0)
      cursor.level = 0;
    return withShape(tree, shape, numbers, limit, [&](const auto &shape) {
      return nextOverlap<Block>(tree, shape, cursor);
    });
  };
  i32 primitive = withTree(id, next);
  *result = {primitive,        cursor.node,     cursor.level,    cursor.block,
             i32(cursor.left), cursor.lowTrail, cursor.highTrail};
}
