//===- GraphOperations.cpp - Arguments of captured operations -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One place for what the arguments of operations mean: where their pointers
// are, and how far those reach.
//
//===----------------------------------------------------------------------===//

#include "GraphOperations.h"

#include "warp/Bvh.h"
#include "warp/Error.h"
#include "warp/Handle.h"
#include "warp/SparseProduct.h"
#include "warp/TreeBuild.h"

#include <algorithm>
#include <cstddef>
#include <limits>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

static constexpr int64_t most = std::numeric_limits<int64_t>::max();

Error graphs::nonsense(const GraphOperation &operation) {
  return Error(Error::Kind::Value,
               "the " + describe(operation) + " has impossible arguments");
}

std::string graphs::describe(const GraphOperation &operation) {
  switch (operation.kind) {
  case Kind::Launch:
    return "launch of '" + (operation.kernel ? operation.kernel->name() : "?") +
           "'";
  case Kind::CopyBytes:
  case Kind::CopyArray:
  case Kind::Upload:
    return "copy";
  case Kind::FillBytes:
  case Kind::FillArray:
    return "fill";
  case Kind::Scan:
    return "scan";
  case Kind::SortPairs:
  case Kind::SortSegments:
    return "sort";
  case Kind::FindRuns:
    return "search for runs";
  case Kind::BuildTree:
    return "build of a hierarchy";
  case Kind::UpdateGeometry:
    return "update of geometry";
  case Kind::MultiplyRows:
    return "sparse product";
  case Kind::Condition:
  case Kind::UpdateCondition:
  case Kind::BeginBody:
  case Kind::EndBody:
    return "branch or loop";
  case Kind::Other:
    break;
  }
  return operation.constant;
}

//===----------------------------------------------------------------------===//
// Pointers
//===----------------------------------------------------------------------===//

namespace {
/// Collects the pointers of one operation, or only where they are.
class Collector {
public:
  Collector(const GraphOperation &operation, bool slotsOnly)
      : operation(operation), slotsOnly(slotsOnly) {}

  /// The pointer at a byte; `bytes` from there on are reached.
  void add(size_t slot, int64_t bytes) {
    if (slotsOnly)
      return found.push_back({slot, {}});
    uint64_t address = pointerAt(slot);
    if (bytes < 0 || (bytes > 0 && !address) ||
        address + uint64_t(bytes) < address)
      throw nonsense(operation);
    found.push_back({slot, {address, address + uint64_t(bytes)}});
  }
  void add(size_t slot, int64_t count, int64_t size) {
    int64_t bytes = 0;
    if (!slotsOnly &&
        (count < 0 || size < 0 || __builtin_mul_overflow(count, size, &bytes)))
      throw nonsense(operation);
    add(slot, bytes);
  }
  /// Elements at a distance.
  void add(size_t slot, const Sequence &sequence, int64_t count,
           int64_t width) {
    int64_t reach = 0;
    if (!slotsOnly &&
        (count < 1 || sequence.stride < 0 || width < 0 ||
         __builtin_mul_overflow(count - 1, sequence.stride, &reach) ||
         reach > most - width))
      throw nonsense(operation);
    add(slot, reach + width);
  }
  /// Data and gradient of the descriptor at a byte; sizes of their elements,
  /// 0 for a gradient that is not used.
  void addArray(size_t slot, int64_t elementSize, int64_t gradientSize) {
    ArrayDescriptor array;
    if (slot > operation.arguments.size() ||
        operation.arguments.size() - slot < sizeof(array))
      throw nonsense(operation);
    std::memcpy(&array, operation.arguments.data() + slot, sizeof(array));
    bool empty = false;
    for (int i = 0; i < std::clamp(array.ndim, 0, maxRank); ++i)
      empty |= array.shape[i] == 0;
    // A kernel may ask whether it has an array, and geometry whether it has
    // groups; a copy has both.
    bool optional = operation.kind == Kind::Launch ||
                    operation.kind == Kind::UpdateGeometry;
    if (!slotsOnly && !optional && !empty && !array.data)
      throw nonsense(operation);
    addElements(slot + offsetof(ArrayDescriptor, data), array, elementSize, 1);
    size_t grad = slot + offsetof(ArrayDescriptor, grad);
    if (gradientSize && elementSize)
      addElements(grad, array, gradientSize, gradientSize / elementSize);
    else
      found.push_back({grad, {}});
  }

  std::vector<Pointer> found;

private:
  uint64_t pointerAt(size_t slot) const {
    uint64_t address;
    std::memcpy(&address, operation.arguments.data() + slot, sizeof(address));
    return address;
  }
  void addElements(size_t slot, const ArrayDescriptor &array, int64_t size,
                   int64_t scale) {
    if (slotsOnly)
      return found.push_back({slot, {}});
    auto *data = reinterpret_cast<const void *>(pointerAt(slot));
    std::optional<AddressRange> range =
        possibleRangeOf(data, array, size, scale);
    if (!range)
      throw nonsense(operation);
    found.push_back({slot, *range});
  }

  const GraphOperation &operation;
  bool slotsOnly;
};
} // namespace

/// 4 or 8.
static int64_t wordOf(const GraphOperation &operation, int64_t size) {
  if (size != 4 && size != 8)
    throw nonsense(operation);
  return size;
}

/// Bytes of a number, for a number that may be none of the enumeration.
static int64_t widthOf(const GraphOperation &operation, int32_t type) {
  if (type < 0 || type > static_cast<int32_t>(NumberType::Float64))
    throw nonsense(operation);
  return sizeOf(static_cast<NumberType>(type));
}

static void collectSequences(const GraphOperation &operation, Collector &all) {
  if (operation.kind == Kind::Scan) {
    auto scan = operation.read<Scan>();
    if (scan.width < 1)
      throw nonsense(operation);
    int64_t width = widthOf(operation, scan.type) * scan.width;
    all.add(offsetof(Scan, out), scan.out, scan.count, width);
    all.add(offsetof(Scan, in), scan.in, scan.count, width);
  } else if (operation.kind == Kind::SortPairs) {
    // There is room for as much again behind keys and values.
    auto sort = operation.read<SortPairs>();
    if (sort.beginBit < 0 || sort.beginBit > sort.endBit || sort.endBit > 64)
      throw nonsense(operation);
    all.add(offsetof(SortPairs, keys), sort.count,
            2 * widthOf(operation, sort.type));
    all.add(offsetof(SortPairs, values), sort.count,
            2 * wordOf(operation, sort.valueSize));
  } else if (operation.kind == Kind::SortSegments) {
    auto sort = operation.read<SortSegments>();
    all.add(offsetof(SortSegments, keys), sort.count,
            2 * widthOf(operation, sort.type));
    all.add(offsetof(SortSegments, values), sort.count,
            2 * wordOf(operation, sort.valueSize));
    all.add(offsetof(SortSegments, begins), sort.segments, 4);
    all.add(offsetof(SortSegments, ends), sort.segments, 4);
  } else {
    auto runs = operation.read<FindRuns>();
    int64_t size = wordOf(operation, runs.size);
    all.add(offsetof(FindRuns, numbers), runs.count, size);
    all.add(offsetof(FindRuns, runNumbers), runs.count, size);
    all.add(offsetof(FindRuns, runLengths), runs.count, 4);
    all.add(offsetof(FindRuns, runCount), 4);
  }
}

static void collectTree(const GraphOperation &operation, Collector &all) {
  auto build = operation.read<graphs::BuildTree>();
  if (build.count < 1)
    throw nonsense(operation);
  TreeShape shape(build.count);
  bool ofTriangles = build.ofTriangles != 0;
  all.add(offsetof(graphs::BuildTree, first), build.points, 12);
  all.add(offsetof(graphs::BuildTree, second), build.count, 12);
  all.add(offsetof(graphs::BuildTree, nodes), shape.nodes(),
          TreeShape::nodeBytes);
  all.add(offsetof(graphs::BuildTree, blocks), shape.blocks,
          TreeShape::blockBytes(ofTriangles));
  all.add(offsetof(graphs::BuildTree, scale), 4);
  all.add(offsetof(graphs::BuildTree, found), 8);
}

/// Throws unless arrays of an update are lists, of which the host reads as many
/// elements as their extents say, and of boxes and groups there are enough.
static void checkLists(const GraphOperation &operation) {
  auto update = operation.read<UpdateGeometry>();
  for (const ArrayDescriptor &array : update.arrays)
    if (array.shape[0] != 0 && (array.ndim != 1 || !array.data))
      throw nonsense(operation);
  auto count = [&](int i) { return update.arrays[i].shape[0]; };
  auto isGroups = [&](int i) { return count(i) == 0 || count(i) == count(0); };
  GeometryKind kind{uint8_t(update.kind)};
  if ((kind == GeometryKind::Bvh && (count(1) != count(0) || !isGroups(2))) ||
      (kind == GeometryKind::HashGrid && !isGroups(1)))
    throw nonsense(operation);
}

static void collectGeometry(const GraphOperation &operation, Collector &all,
                            bool slotsOnly) {
  auto update = operation.read<UpdateGeometry>();
  if (update.rebuilds < 0 || update.rebuilds > 1 || update.constructor < 0 ||
      update.constructor > int32_t(BvhConstructor::Median))
    throw nonsense(operation);
  std::vector<int64_t> sizes;
  switch (GeometryKind(update.kind)) {
  case GeometryKind::HashGrid:
    if (update.scalarSize != 2 && update.scalarSize != 4 &&
        update.scalarSize != 8)
      throw nonsense(operation);
    sizes = {3 * update.scalarSize, 4};
    break;
  case GeometryKind::Bvh:
    sizes = {12, 12, 4};
    break;
  case GeometryKind::Mesh:
    sizes = {12, 12, 4, 4};
    break;
  default:
    throw nonsense(operation);
  }
  for (size_t i = 0; i < sizes.size(); ++i)
    all.addArray(offsetof(UpdateGeometry, arrays) + i * sizeof(ArrayDescriptor),
                 sizes[i], 0);
  if (!slotsOnly)
    checkLists(operation);
}

static void collectProduct(const GraphOperation &operation, Collector &all) {
  auto product = operation.read<SparseProduct>();
  int64_t size = widthOf(operation, static_cast<int32_t>(product.kind));
  all.add(offsetof(SparseProduct, offsets), product.rows + 1, 4);
  all.add(offsetof(SparseProduct, columns), product.capacity, 4);
  all.add(offsetof(SparseProduct, values), product.capacity, size);
  all.add(offsetof(SparseProduct, x), product.width, size);
  all.add(offsetof(SparseProduct, y), product.rows, size);
}

static std::vector<Pointer> collect(const GraphOperation &operation,
                                    const std::vector<Access> &accesses,
                                    bool slotsOnly) {
  Collector all(operation, slotsOnly);
  switch (operation.kind) {
  case Kind::Launch:
    for (const Access &access : accesses)
      all.addArray(access.offset, access.elementSize, access.gradientSize);
    break;
  case Kind::CopyBytes: {
    auto copy = operation.read<CopyBytes>();
    int64_t bytes = copy.bytes > uint64_t(most) ? -1 : int64_t(copy.bytes);
    all.add(offsetof(CopyBytes, dst), bytes);
    all.add(offsetof(CopyBytes, src), bytes);
    break;
  }
  case Kind::CopyArray: {
    auto copy = operation.read<CopyArray>();
    int64_t size =
        copy.elementSize > uint64_t(most) ? -1 : int64_t(copy.elementSize);
    all.addArray(offsetof(CopyArray, dst), size, 0);
    all.addArray(offsetof(CopyArray, src), size, 0);
    break;
  }
  case Kind::Upload:
    all.add(offsetof(Upload, dst), int64_t(operation.constant.size()));
    break;
  case Kind::FillBytes:
    all.add(offsetof(FillBytes, dst),
            int64_t(operation.read<FillBytes>().count),
            int64_t(operation.constant.size()));
    break;
  case Kind::FillArray:
    all.addArray(offsetof(FillArray, dst), int64_t(operation.constant.size()),
                 0);
    break;
  case Kind::Condition:
  case Kind::UpdateCondition:
    all.add(offsetof(Condition, value), 4);
    break;
  case Kind::BuildTree:
    collectTree(operation, all);
    break;
  case Kind::UpdateGeometry:
    collectGeometry(operation, all, slotsOnly);
    break;
  case Kind::MultiplyRows:
    collectProduct(operation, all);
    break;
  case Kind::BeginBody:
  case Kind::EndBody:
  case Kind::Other:
    break;
  default:
    collectSequences(operation, all);
  }
  return std::move(all.found);
}

std::vector<Pointer> graphs::pointersOf(const GraphOperation &operation,
                                        const std::vector<Access> &accesses) {
  return collect(operation, accesses, false);
}

std::vector<size_t> graphs::slotsOf(const GraphOperation &operation,
                                    const std::vector<Access> &accesses) {
  std::vector<size_t> slots;
  for (const Pointer &pointer : collect(operation, accesses, true))
    slots.push_back(pointer.slot);
  return slots;
}

void graphs::checkArguments(const GraphOperation &operation,
                            size_t parameterSize) {
  auto sizeOfArguments = [&]() -> size_t {
    switch (operation.kind) {
    case Kind::Launch:
      return parameterSize;
    case Kind::CopyBytes:
      return sizeof(CopyBytes);
    case Kind::CopyArray:
      return sizeof(CopyArray);
    case Kind::Upload:
      return sizeof(Upload);
    case Kind::FillBytes:
      return sizeof(FillBytes);
    case Kind::FillArray:
      return sizeof(FillArray);
    case Kind::Scan:
      return sizeof(Scan);
    case Kind::SortPairs:
      return sizeof(SortPairs);
    case Kind::SortSegments:
      return sizeof(SortSegments);
    case Kind::FindRuns:
      return sizeof(FindRuns);
    case Kind::BuildTree:
      return sizeof(graphs::BuildTree);
    case Kind::UpdateGeometry:
      return sizeof(UpdateGeometry);
    case Kind::MultiplyRows:
      return sizeof(SparseProduct);
    case Kind::Condition:
    case Kind::UpdateCondition:
      return sizeof(Condition);
    case Kind::BeginBody:
      return sizeof(Body);
    case Kind::EndBody:
      return 0;
    case Kind::Other:
      break;
    }
    throw Error(Error::Kind::Value, "an operation is of no known kind");
  };
  bool fills = operation.kind == Kind::FillBytes ||
               operation.kind == Kind::FillArray ||
               operation.kind == Kind::Upload;
  if (operation.arguments.size() != sizeOfArguments() ||
      fills == operation.constant.empty())
    throw nonsense(operation);
}
