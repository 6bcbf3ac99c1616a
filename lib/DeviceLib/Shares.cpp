//===- Shares.cpp - Work division of block-wide queries -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Shares.h"
#include "geometry/Exports.h"
#include "geometry/Shapes.h"

using namespace warp::geometry;

WARP_GEOMETRY warp_overlap_share(u64 id, i32 shape, f32 a, f32 b, f32 c, f32 d,
                                 f32 e, f32 f, f32 g, i32 thread, i32 threads,
                                 OverlapShare *result) {
  const f32 numbers[7] = {a, b, c, d, e, f, g};
  Cursor cursor{0, -1, 0, 0, 0, 0, 0};
  withTree(id, [&]<class Block>(const Tree &tree, Block *) {
    return withShape(tree, shape, numbers, infinity, [&](const auto &shape) {
      takeShare<Block>(tree, shape, thread, threads, cursor);
      return 0;
    });
  });
  *result = {cursor.node,      cursor.level,    cursor.block,
             i32(cursor.left), cursor.lowTrail, cursor.highTrail};
}
