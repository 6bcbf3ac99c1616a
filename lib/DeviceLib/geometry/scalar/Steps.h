//===- Steps.h - Nodes as a thread with scalars reads them ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sixteen bytes at a time, of a GPU's global memory.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H

#include "../Tree.h"

namespace warp::geometry::scalar {

using Four = f32 __attribute__((ext_vector_type(4)));
using FourInts = i32 __attribute__((ext_vector_type(4)));

#ifdef __NVPTX__
template <class T> using Global = const T __attribute__((address_space(1))) *;
#else
template <class T> using Global = const T *;
#endif

using Bytes = Global<u8>;

template <class T> inline T load(Bytes at) { return *(Global<T>)at; }

#ifdef __NVPTX__
/// NaN loses; an instruction each.
inline f32 lower(f32 a, f32 b) { return __nvvm_fmin_f(a, b); }
inline f32 upper(f32 a, f32 b) { return __nvvm_fmax_f(a, b); }
/// Within 2^-22; infinite for what is less than the least normal number.
inline f32 roughInverse(f32 x) { return __nvvm_rcp_approx_ftz_f(x); }
#else
inline f32 lower(f32 a, f32 b) { return __builtin_fminf(a, b); }
inline f32 upper(f32 a, f32 b) { return __builtin_fmaxf(a, b); }
inline f32 roughInverse(f32 x) { return 1 / x; }
#endif

/// What a node says of its children, in the order it is kept.
struct Links {
  FourInts words;

  explicit Links(Bytes node)
      : words(load<FourInts>(node + __builtin_offsetof(Node, firstNode))) {}
  u32 nodes() const { return u32(words[3]) & 0xff; }
  u32 blocks() const { return u32(words[3]) >> 8 & 0xff; }
  u32 children() const { return nodes() | blocks(); }
  /// Where a child is: a node, or a block with all bits flipped.
  i32 follow(u32 child) const {
    u32 below = (1u << child) - 1;
    if (blocks() >> child & 1)
      return ~(words[1] + countBits(blocks() & below));
    return words[0] + countBits(nodes() & below);
  }
};
static_assert(__builtin_offsetof(Node, nodes) ==
              __builtin_offsetof(Node, firstNode) + 12);

/// A child that is not to be visited. Others begin with their distance, whose
/// last three bits are the child's number; smaller is closer.
constexpr u32 noKey = 0xffffffff;

inline u32 keyOf(f32 distance, u32 child) {
  return (__builtin_bit_cast(u32, distance) & ~7u) | child;
}

inline void order(u32 &a, u32 &b) {
  u32 low = a < b ? a : b;
  b = a < b ? b : a;
  a = low;
}

/// Sorts eight keys (Batcher's merge exchange).
inline void sortKeys(u32 (&key)[width]) {
  auto sort = [&](int a, int b) { order(key[a], key[b]); };
  sort(0, 1), sort(2, 3), sort(4, 5), sort(6, 7);
  sort(0, 2), sort(1, 3), sort(4, 6), sort(5, 7);
  sort(1, 2), sort(5, 6);
  sort(0, 4), sort(1, 5), sort(2, 6), sort(3, 7);
  sort(2, 4), sort(3, 5);
  sort(1, 2), sort(3, 4), sort(5, 6);
}

/// What leads to no child.
constexpr i32 nowhere = -0x7fffffff - 1;

/// A child that is left for later: its key, and the node that it is of.
struct Rest {
  u32 key;
  i32 node;
};
constexpr int maxRests = maxDepth * (width - 1) + 1;

/// Children that are left for later, the last one first. Their memory is apart:
/// what is in one object with it would be in memory, too.
class Rests {
public:
  explicit Rests(Bytes nodes) : nodes(nodes) {}

  /// Keys above this one are too far by now.
  u32 farthest = noKey;

  void leave(u32 key, i32 node) { left[count++] = {key, node}; }

  /// The next child that is not too far; `nowhere` after the last one.
  i32 next() {
    while (count) {
      auto [key, node] = left[--count];
      if (key <= farthest)
        return Links(nodes + i64(node) * i64(sizeof(Node))).follow(key & 7);
    }
    return nowhere;
  }

  /// Searches a tree from its root on: `enter` gives where to go from a node,
  /// `visit` whether to go on after a block.
  template <class Enter, class Visit>
  void search(i32 root, Enter enter, Visit visit) {
    Rest memory[maxRests];
    left = memory;
    i32 at = root;
    for (;;) {
      // Threads of a warp wait here until each is at a block.
      while (at >= 0)
        at = enter(at);
      if (at == nowhere || !visit(~at))
        return;
      at = next();
    }
  }

private:
  Bytes nodes;
  int count = 0;
  Rest *left = nullptr;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H
