//===- Regions.h - Access regions of an array in a launch -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A `Region` is memory: a few strided blocks. A `RegionFormula` says which
// elements of its arrays a kernel may read and write, as sums over thread
// indices, loop counters and integers that are known at the launch;
// `findRegions` evaluates it. An index that is no such sum stands for the whole
// dimension, so a region may be too large and is never too small.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_REGIONS_H
#define WARP_REGIONS_H

#include "warp/Export.h"
#include "warp/Launch.h"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace warp {

struct Access;
struct LaunchDim;
class Module;

/// Elements at `start` plus sums of multiples of strides.
struct WARP_API MemoryBlock {
  /// Multiples 0, step, 2 step, ... of a stride, `count` of them.
  struct Dim {
    int64_t stride = 0, step = 1, count = 1;
    bool operator==(const Dim &other) const {
      return stride == other.stride && step == other.step &&
             count == other.count;
    }
  };

  uint64_t start = 0;
  /// Bytes of an element.
  int64_t item = 0;
  /// Dimensions of two multiples and more, largest stride first; all positive.
  int rank = 0;
  Dim dims[maxRank];

  bool operator==(const MemoryBlock &other) const;
  /// After the last byte.
  uint64_t end() const;
  int64_t bytes() const;
};

/// True if two blocks share a byte; may say so of strides that do not nest.
WARP_API bool overlap(const MemoryBlock &a, const MemoryBlock &b);
/// The elements of `a` that share a byte with `b`, or more of `a` where strides
/// do not nest; false if there are none.
WARP_API bool intersect(const MemoryBlock &a, const MemoryBlock &b,
                        MemoryBlock &shared);

struct WARP_API Region {
  std::vector<MemoryBlock> blocks;

  bool operator==(const Region &other) const { return blocks == other.blocks; }
  /// Adds a block, unless another one has its elements.
  void add(const MemoryBlock &block);
  bool overlaps(const Region &other) const;
  /// The elements of this region that share bytes with another one.
  Region shared(const Region &other) const;
  /// True if it is known that every element is one of the other region.
  bool isWithin(const Region &other) const;
  int64_t bytes() const;
  size_t hash() const;
};

/// The whole of an array.
WARP_API MemoryBlock blockOf(const ArrayDescriptor &array, int64_t itemSize);

/// The access regions of a kernel.
struct RegionFormula {
  enum class Op : uint8_t {
    Constant,    // a
    Extent,      // of the launch, dimension a
    Argument,    // integer of `bits` at byte a of the parameter block
    ArrayExtent, // of the descriptor at byte a, dimension b
    // Operations on the nodes a and b; they wrap like integers of `bits`.
    Add,
    Sub,
    Mul,
    Div,
    FloorDiv,
    Mod,
    Min,
    Max,
    And,
    Or,
    Xor,
    ShiftLeft,
    ShiftRight,
    Cast, // a
  };
  /// An integer that all threads agree on; operands are earlier nodes.
  struct Node {
    Op op = Op::Constant;
    uint8_t bits = 64;
    bool isSigned = true;
    int64_t a = 0, b = 0;
    bool operator==(const Node &other) const {
      return op == other.op && bits == other.bits &&
             isSigned == other.isSigned && a == other.a && b == other.b;
    }
  };
  /// `factor` times 0, 1, ..., `count` - 1; both are nodes.
  struct Symbol {
    int32_t factor = 0, count = 0;
  };
  /// A node plus symbols; any index if `base` is -1.
  struct Index {
    int32_t base = -1;
    /// Negative values are indices from the end; without, there are none.
    bool mayWrap = true;
    std::vector<Symbol> symbols;
  };
  struct Access {
    /// Number among the arrays in the arguments.
    int32_t array = 0;
    bool reads = false, writes = false;
    /// The bounds of the first dimensions; the rest is accessed as a whole.
    std::vector<Index> indices;
  };

  std::vector<Node> nodes;
  std::vector<Access> accesses;
  /// Arrays of which accesses are missing in the list.
  std::vector<bool> unknown;
  /// The kernel may reach memory that no argument names: behind handles and
  /// addresses, by native code.
  bool isOpen = false;
  /// It prints.
  bool prints = false;
};

/// The access regions of a module's kernel.
WARP_API RegionFormula regionFormula(const Module &module);
/// The same as text, a line per access: "write x[(k + 1), 0 + 1 * extent(0)]",
/// where `factor * count` is factor times 0, 1, ... below count.
WARP_API std::string regionText(const Module &module);

/// The accesses of a launch to one array.
struct ArrayRegions {
  Region read, written;
};

/// The regions of a launch by array, in the order of `accesses`. `params` is
/// the parameter block; its header need not be filled.
WARP_API void findRegions(const RegionFormula &formula,
                          const std::vector<Access> &accesses,
                          const LaunchDim &dim, const void *params,
                          std::vector<ArrayRegions> &regions);

} // namespace warp

#endif // WARP_REGIONS_H
