//===- RegionBoxes.cpp - Bounding boxes of accessed elements --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "RegionBoxes.h"

#include <algorithm>
#include <numeric>

using namespace warp;

static Span hullOf(const Span &a, const Span &b) {
  return {std::min(a.start, b.start), std::max(a.last, b.last),
          std::max<int64_t>(1, std::gcd(std::gcd(a.isOne() ? 0 : a.step,
                                                 b.isOne() ? 0 : b.step),
                                        std::abs(a.start - b.start)))};
}

/// True if the hull of two spans has no element that neither has.
static bool isTight(const Span &a, const Span &b, const Span &hull) {
  if (hull == a || hull == b)
    return true;
  // Others may fill the gap between two elements.
  if (a.isOne() && b.isOne())
    return hull.step == 1;
  if ((!a.isOne() && a.step != hull.step) ||
      (!b.isOne() && b.step != hull.step))
    return false;
  return a.start <= b.last + hull.step && b.start <= a.last + hull.step;
}

/// Makes one box of two if that adds nothing.
bool Boxes::join(Box &into, const Box &other) const {
  int different = -1;
  bool holds = true, isHeld = true;
  for (int i = 0; i < rank; ++i) {
    holds &= into.dims[i].has(other.dims[i]);
    isHeld &= other.dims[i].has(into.dims[i]);
    if (!(into.dims[i] == other.dims[i]))
      different = different < 0 ? i : maxRank;
  }
  if (holds)
    return true;
  if (isHeld) {
    into = other;
    return true;
  }
  if (different < 0 || different == maxRank)
    return false;
  Span &span = into.dims[different];
  Span hull = hullOf(span, other.dims[different]);
  if (!isTight(span, other.dims[different], hull))
    return false;
  span = hull;
  return true;
}

void Boxes::add(Box box) {
  for (int i = 0; i < count;) {
    if (!join(box, boxes[i])) {
      ++i;
      continue;
    }
    boxes[i] = boxes[--count];
    i = 0;
  }
  boxes[count++] = box;
  if (count <= mostBoxes)
    return;
  for (; count > 1; --count)
    for (int i = 0; i < rank; ++i)
      boxes[0].dims[i] = hullOf(boxes[0].dims[i], boxes[count - 1].dims[i]);
}
