//===- RegionBoxes.h - Bounding boxes of accessed elements ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Boxes of progressions. Boxes of one array that continue each other become
// one.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_REGIONBOXES_H
#define WARP_LIB_RUNTIME_REGIONBOXES_H

#include "warp/Launch.h"

#include <cstdint>

namespace warp {

/// Indices start, start + step, ..., last.
struct Span {
  int64_t start = 0, last = 0, step = 1;

  bool operator==(const Span &other) const {
    return start == other.start && last == other.last && step == other.step;
  }
  bool has(const Span &other) const {
    return start <= other.start && other.last <= last &&
           (step == 1 || ((other.start - start) % step == 0 &&
                          (other.step % step == 0 || other.isOne())));
  }
  bool isOne() const { return start == last; }
};

struct Box {
  Span dims[maxRank];
};

/// Boxes of one array that one kind of access touches.
class Boxes {
public:
  explicit Boxes(int rank) : rank(rank) {}

  void add(Box box);
  int size() const { return count; }
  const Box &operator[](int i) const { return boxes[i]; }

private:
  bool join(Box &into, const Box &other) const;

  int rank, count = 0;
  /// More become their hull.
  static constexpr int mostBoxes = 8;
  Box boxes[mostBoxes + 1];
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_REGIONBOXES_H
