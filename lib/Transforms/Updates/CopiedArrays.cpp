//===- CopiedArrays.cpp - Privatization of updated arrays -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A worker may update a copy in place of an array if nothing but sums, minima
// or maxima happen to the array in the launch: then nobody sees before the end
// of it which of the two a number went to. Every access of the kernel is asked
// for the memory it may mean (Analysis/ArrayOrigins.h), so views and fields of
// structs count. One access of unknown memory is enough to give up, since it
// may mean a copied array; so is one atomic update that copies cannot take
// over, since all updates of the code lose their atomic instructions together.
//
//===----------------------------------------------------------------------===//

#include "CopiedArrays.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/CostModel.h"
#include "Atomics.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/IR/Builders.h"
#include "mlir/Interfaces/CallInterfaces.h"

#include <map>

using namespace mlir;

/// The way in which an update changes numbers if a copy can receive it.
static std::optional<warp::CopyKind> kindOf(warp::AccessOp op) {
  auto kind = op.getCombination();
  if (!op.isUpdate() || !op->use_empty() || warp::getUpdate(op).isExact() ||
      !kind)
    return std::nullopt;
  switch (warp::combiningKind(*kind)) {
  case warp::AtomicKind::add:
    return warp::CopyKind::sum;
  case warp::AtomicKind::min:
    return warp::CopyKind::min;
  case warp::AtomicKind::max:
    return warp::CopyKind::max;
  default:
    return std::nullopt;
  }
}

/// The type of all its numbers; null if they differ, or have another width.
static Type typeOf(warp::AccessOp op) {
  auto types = op.getWritten().getTypes();
  Type type = types.front();
  if (!llvm::all_equal(types) || !(type.isF32() || type.isF64() ||
                                   type.isInteger(32) || type.isInteger(64)))
    return {};
  return type;
}

namespace {

/// The effects of a kernel on one memory.
struct Uses {
  /// The numbers of all its updates, and what those do.
  Type number;
  warp::CopyKind kind = warp::CopyKind::sum;
  bool isAtomic = false, others = false;
};

class Finder {
public:
  explicit Finder(FunctionOpInterface kernel)
      : kernel(kernel), origins(kernel, /*disjoint=*/true) {}

  /// The arrays that a kernel in phase `launch` updates atomically, if all of
  /// these updates do the same and nothing else happens to the arrays, provided
  /// that those of a launch are disjoint. None otherwise.
  std::vector<warp::CopiedArray> run();

private:
  bool visit(Operation *op);
  void locate();
  std::optional<warp::CopiedArray> describe(warp::ArrayMemory memory,
                                            const Uses &use);

  FunctionOpInterface kernel;
  warp::ArrayOrigins origins;
  std::map<warp::ArrayMemory, Uses> uses;
  /// The array leaves of the arguments, as the parameter block has them.
  SmallVector<warp::Leaf> arrays;
};

} // namespace

/// False if the operation rules out copies.
bool Finder::visit(Operation *op) {
  if (isa<CallOpInterface>(op))
    return llvm::none_of(op->getOperandTypes(),
                         [](Type type) { return isa<warp::ArrayType>(type); });
  auto access = dyn_cast<warp::AccessOp>(op);
  if (!access)
    return true;
  warp::ArrayOrigin origin = origins.of(access.getArray());
  if (!origin.isComplete)
    return false;
  std::optional<warp::CopyKind> kind = kindOf(access);
  Type number = kind ? typeOf(access) : Type();
  bool isAtomic = access.isUpdate() && access.isAtomic();
  if (isAtomic && !number)
    return false;
  for (warp::ArrayMemory memory : origin.memories) {
    Uses &use = uses[memory];
    use.others |=
        !number || (use.number && (use.number != number || use.kind != *kind));
    use.number = number;
    use.kind = kind.value_or(use.kind);
    use.isAtomic |= isAtomic;
  }
  return true;
}

void Finder::locate() {
  SmallVector<Type> types(kernel.getArgumentTypes());
  if (auto declared = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes)) {
    auto values = declared.getAsValueRange<TypeAttr>();
    types.assign(values.begin(), values.end());
  }
  warp::ParameterLayout layout = warp::layOutParameters(types);
  SmallVector<warp::Leaf> leaves;
  for (auto [type, offset] : llvm::zip_equal(types, layout.offsets))
    warp::collectLeaves(type, offset, leaves);
  for (warp::Leaf leaf : leaves)
    if (isa<warp::ArrayType>(leaf.type))
      arrays.push_back(leaf);
}

/// None if an element is more than numbers of one type.
std::optional<warp::CopiedArray> Finder::describe(warp::ArrayMemory memory,
                                                  const Uses &use) {
  Type number = use.number;
  warp::Leaf leaf = arrays[memory.leaf];
  Type element = cast<warp::ArrayType>(leaf.type).getElementType();
  int64_t size = warp::getByteSize(element);
  if (memory.isGradient)
    element = warp::getGradientElement(element);
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(element, 0, leaves);
  int64_t width = number.getIntOrFloatBitWidth(), count = leaves.size();
  bool isUnsigned = leaves.front().type.isUnsignedInteger();
  bool fits = llvm::all_of(leaves, [&](warp::Leaf part) {
    return part.type.isIntOrFloat() &&
           part.type.isUnsignedInteger() == isUnsigned &&
           int64_t(part.type.getIntOrFloatBitWidth()) == width &&
           isa<FloatType>(part.type) == isa<FloatType>(number);
  });
  if (!fits || count * width / 8 != warp::getByteSize(element))
    return std::nullopt;
  return warp::CopiedArray{
      leaf.offset, memory.isGradient,      size,       count,
      width,       isa<FloatType>(number), isUnsigned, use.kind};
}

std::vector<warp::CopiedArray> Finder::run() {
  bool allowed =
      !kernel
           ->walk([&](Operation *op) {
             return visit(op) ? WalkResult::advance() : WalkResult::interrupt();
           })
           .wasInterrupted();
  std::vector<warp::CopiedArray> found;
  if (!allowed)
    return found;
  locate();
  for (auto &[memory, use] : uses) {
    if (!use.isAtomic)
      continue;
    auto array = use.others ? std::nullopt : describe(memory, use);
    if (!array)
      return {};
    found.push_back(*array);
  }
  return found;
}

/// In picoseconds.
static int64_t toTime(double cycles) {
  return int64_t(cycles / warp::cost::cyclesPerNanosecond * 1e3);
}

bool warp::offerCopies(FunctionOpInterface kernel, const UpdateCosts &costs) {
  SmallVector<Attribute> list;
  MLIRContext *context = kernel->getContext();
  for (const CopiedArray &array : Finder(kernel).run())
    list.push_back(CopiedArrayAttr::get(
        context, array.descriptor, array.gradient, array.elementSize,
        array.numbers, array.width, array.floating, array.isUnsigned,
        int64_t(array.kind)));
  if (list.empty())
    return false;
  auto copied = CopiedAttr::get(context, ArrayAttr::get(context, list),
                                toTime(costs.plain), toTime(costs.atomic));
  setSchedule(kernel, getSchedule(kernel).withCopied(copied));
  return true;
}
