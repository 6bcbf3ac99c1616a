//===- Steps.h - BVH node access of scalar traversal ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sixteen bytes at a time, of a GPU's global memory.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H

#include "../Tree.h"

#ifdef WARP_GPU
#include "../../gpu/Gpu.h"
#endif

namespace warp::geometry::scalar {

using Four = f32 __attribute__((ext_vector_type(4)));
using FourInts = i32 __attribute__((ext_vector_type(4)));

#ifdef WARP_GPU
template <class T> using Global = const T __attribute__((address_space(1))) *;
#else
template <class T> using Global = const T *;
#endif

using Bytes = Global<u8>;

template <class T> inline T load(Bytes at) { return *(Global<T>)at; }

#ifdef WARP_GPU
/// NaN loses; an instruction each.
inline f32 lower(f32 a, f32 b) { return gpu::minimum(a, b); }
inline f32 upper(f32 a, f32 b) { return gpu::maximum(a, b); }
/// Within 2^-22; infinite for what is less than the least normal number.
inline f32 roughInverse(f32 x) { return gpu::flushedReciprocal(x); }
#else
inline f32 lower(f32 a, f32 b) { return __builtin_fminf(a, b); }
inline f32 upper(f32 a, f32 b) { return __builtin_fmaxf(a, b); }
inline f32 roughInverse(f32 x) { return 1 / x; }
#endif

inline i32 lower(i32 a, i32 b) { return a < b ? a : b; }
inline i32 upper(i32 a, i32 b) { return a > b ? a : b; }

/// The bits of a number, and the number that some are.
inline i32 integerOf(f32 x) { return __builtin_bit_cast(i32, x); }
inline f32 floatOf(i32 bits) { return __builtin_bit_cast(f32, bits); }

/// A node's record of its children, in the order it is kept.
struct Links {
  FourInts words;

  explicit Links(Bytes node)
      : words(load<FourInts>(node + __builtin_offsetof(Node, firstNode))) {}
  u32 nodes() const { return u32(words[3]) & 0xff; }
  u32 blocks() const { return u32(words[3]) >> 8 & 0xff; }
  u32 children() const { return nodes() | blocks(); }
  /// The number of a child: a node, or a block with all bits flipped.
  i32 follow(u32 child) const {
    bool isBlock = blocks() >> child & 1;
    u32 alike = isBlock ? blocks() : nodes();
    i32 before = countBits(alike & ((1u << child) - 1));
    return isBlock ? ~(words[1] + before) : words[0] + before;
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

/// The word that leads to no child.
constexpr i32 nowhere = -0x7fffffff - 1;

/// A child that is left for later: its key, and where it is, as `follow` has
/// it.
struct Rest {
  i32 key, to;
};
constexpr int maxRests = maxDepth * (width - 1) + 1;

/// Children that are left for later, the last one first. Their memory is apart:
/// what is in one object with it would be in memory, too.
class Rests {
public:
  explicit Rests(Rest (&memory)[maxRests]) : left(memory) {}

  void leave(Rest rest) { left[count++] = rest; }

  /// Takes the next one whose key is not above a bound, if there is one.
  bool take(i32 farthest, Rest &rest) {
    while (count) {
      rest = left[--count];
      if (rest.key <= farthest)
        return true;
    }
    return false;
  }

private:
  int count = 0;
  Rest *left;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_STEPS_H
