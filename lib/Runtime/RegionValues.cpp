//===- RegionValues.cpp - Integers of a formula at a launch ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "RegionValues.h"

#include <algorithm>
#include <cstring>
#include <iterator>

using namespace warp;

using Op = RegionFormula::Op;
using Node = RegionFormula::Node;

static int64_t wrap(int64_t value, unsigned bits, bool isSigned) {
  if (bits >= 64)
    return value;
  unsigned shift = 64 - bits;
  auto moved = static_cast<uint64_t>(value) << shift;
  return isSigned ? static_cast<int64_t>(moved) >> shift
                  : static_cast<int64_t>(moved >> shift);
}

/// Kernels give 0 for a zero divisor, and the smallest number by -1 wraps.
static int64_t divide(Op op, int64_t a, int64_t b) {
  if (b == 0)
    return 0;
  if (b == -1)
    return op == Op::Mod ? 0 : static_cast<int64_t>(0 - uint64_t(a));
  if (op == Op::Mod)
    return a % b;
  return a / b - (op == Op::FloorDiv && a % b != 0 && (a < 0) != (b < 0));
}

static int64_t combine(const Node &node, int64_t a, int64_t b) {
  auto x = static_cast<uint64_t>(a), y = static_cast<uint64_t>(b);
  switch (node.op) {
  case Op::Add:
    return static_cast<int64_t>(x + y);
  case Op::Sub:
    return static_cast<int64_t>(x - y);
  case Op::Mul:
    return static_cast<int64_t>(x * y);
  case Op::Div:
  case Op::FloorDiv:
  case Op::Mod:
    return divide(node.op, a, b);
  case Op::Min:
    return std::min(a, b);
  case Op::Max:
    return std::max(a, b);
  case Op::And:
    return a & b;
  case Op::Or:
    return a | b;
  case Op::Xor:
    return a ^ b;
  case Op::ShiftLeft:
    return y < node.bits ? static_cast<int64_t>(x << y) : 0;
  case Op::ShiftRight:
    return a >> std::min<uint64_t>(y, 63);
  default:
    return a;
  }
}

static int64_t readInteger(const char *from, const Node &node) {
  uint64_t value = 0;
  std::memcpy(&value, from, node.bits / 8);
  return static_cast<int64_t>(value);
}

int64_t RegionValues::evaluate(const Node &node, const LaunchDim &dim,
                               const char *params) const {
  switch (node.op) {
  case Op::Constant:
    return node.a;
  case Op::Extent:
    return node.a < dim.rank ? dim.extent[node.a] : 1;
  case Op::Argument:
    return readInteger(params + node.a, node);
  case Op::ArrayExtent: {
    int32_t extent;
    std::memcpy(&extent,
                params + node.a + offsetof(ArrayDescriptor, shape) +
                    node.b * sizeof(extent),
                sizeof(extent));
    return extent;
  }
  case Op::Cast:
    return data[node.a];
  default:
    return combine(node, data[node.a], data[node.b]);
  }
}

RegionValues::RegionValues(const RegionFormula &formula, const LaunchDim &dim,
                           const void *params) {
  size_t count = formula.nodes.size();
  if (count > std::size(local)) {
    more.resize(count);
    data = more.data();
  }
  auto *bytes = static_cast<const char *>(params);
  for (size_t i = 0; i < count; ++i) {
    const Node &node = formula.nodes[i];
    data[i] = wrap(evaluate(node, dim, bytes), node.bits, node.isSigned);
  }
}
