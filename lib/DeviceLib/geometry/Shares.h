//===- Shares.h - Block-wide queries: shared traversal ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each thread walks down from the root with the range of threads that it is in.
// The children that the shape meets are dealt to the range in order, so the
// range shrinks, until a thread has children for itself; from there it goes on
// alone with an iterator whose upper levels have nothing left. Threads decide
// alike without telling each other, and everything belongs to one of them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SHARES_H
#define WARP_DEVICELIB_GEOMETRY_SHARES_H

#include "Overlap.h"

namespace warp::geometry {

/// The bits that are the `first`th to the one before the `end`th of a mask.
inline u32 rangeOfBits(u32 mask, i32 first, i32 end) {
  u32 kept = 0;
  for (i32 i = 0; mask && i < end; ++i, mask &= mask - 1)
    if (i >= first)
      kept |= mask & -mask;
  return kept;
}

/// Sets a cursor at its start to what one of several threads is to visit.
template <class Block, class Shape>
inline void takeShare(const Tree &tree, const Shape &shape, i32 thread,
                      i32 threads, Cursor &cursor) {
  auto *blocks = static_cast<const Block *>(tree.blocks);
  if (!tree.nodes)
    return;
  while (true) {
    const Node &node = tree.nodes[cursor.node];
    u32 met = shape.test(ChildBounds{node}) & node.children();
    i32 count = countBits(met);
    ++cursor.level;
    if (count >= threads) {
      cursor.setRemaining(rangeOfBits(met, thread * count / threads,
                                      (thread + 1) * count / threads));
      return;
    }
    cursor.setRemaining(0);
    if (count == 0)
      return;
    // Threads with the same quotient share a child.
    i32 rank = thread * count / threads;
    i32 first = (rank * threads + count - 1) / count;
    i32 end = ((rank + 1) * threads + count - 1) / count;
    thread -= first;
    threads = end - first;
    int child = lowestBit(rangeOfBits(met, rank, rank + 1));
    if (node.blocks >> child & 1) {
      cursor.block = node.blockAt(child);
      u32 touched = shape.test(blocks[cursor.block]);
      i32 primitives = countBits(touched);
      cursor.left = rangeOfBits(touched, thread * primitives / threads,
                                (thread + 1) * primitives / threads);
      return;
    }
    cursor.node = node.nodeAt(child);
  }
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_SHARES_H
