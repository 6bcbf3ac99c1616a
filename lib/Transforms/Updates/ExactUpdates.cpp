//===- ExactUpdates.cpp - Choose the sums that are exact ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The bits of a sum of floats depend on the order of its terms, and the order
// of atomic updates is open. A deterministic launch makes such sums in integers
// instead (include/warp/ExactSums.h), where any order will do; the array gets
// them after the launch. That is the same only if the kernel does nothing else
// to the array than add to it, by whatever views. An array that it also reads
// or stores to keeps its updates, and the launch their order.
//
// The list that the kernel gets also names the arrays that the launch accesses
// otherwise: should one of them lie in the same memory, the runtime asks for
// code that keeps the order.
//
//===----------------------------------------------------------------------===//

#include "ExactUpdates.h"

#include "Atomics.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "warp/ExactSums.h"

#include "mlir/IR/Builders.h"

using namespace mlir;

/// Bits of the floats that an update adds, 0 if it does anything else.
static int64_t sumWidth(warp::AccessOp op) {
  auto kind = op.getCombination();
  if (!op->use_empty() ||
      (kind != warp::AtomicKind::add && kind != warp::AtomicKind::sub))
    return 0;
  auto types = op.getWritten().getTypes();
  Type type = types.front();
  return llvm::all_equal(types) && (type.isF32() || type.isF64())
             ? type.getIntOrFloatBitWidth()
             : 0;
}

namespace {

/// The effects of the kernel on an array, by all its views.
struct Uses {
  SmallVector<warp::AccessOp> sums;
  bool others = false;

  void collect(Value array);
};

class ExactUpdates {
public:
  explicit ExactUpdates(FunctionOpInterface kernel) : kernel(kernel) {}

  void run();

private:
  void visit(BlockArgument array, int64_t descriptor);
  void record(const Uses &uses, int64_t descriptor, bool gradient, Type element,
              int64_t scale);

  MLIRContext *context() { return kernel->getContext(); }

  FunctionOpInterface kernel;
  /// The size of the parameter block; descriptors of sums come next.
  int64_t argumentsEnd = 0;
  SmallVector<Attribute> sums, accessed;
};

} // namespace

void Uses::collect(Value array) {
  for (Operation *user : array.getUsers()) {
    if (isa<warp::DimOp, warp::GradOp>(user))
      continue;
    if (isa<warp::ArrayViewOp>(user)) {
      collect(user->getResult(0));
      continue;
    }
    auto access = dyn_cast<warp::AccessOp>(user);
    if (access && sumWidth(access))
      sums.push_back(access);
    else
      others = true;
  }
}

void ExactUpdates::record(const Uses &uses, int64_t descriptor, bool gradient,
                          Type element, int64_t scale) {
  auto entry = [&](int64_t width) {
    return warp::SummedArrayAttr::get(context(), width, descriptor, gradient,
                                      warp::getByteSize(element), scale);
  };
  if (uses.others) {
    accessed.push_back(entry(0));
    return;
  }
  for (int64_t width : {32, 64}) {
    bool any = false;
    int64_t place =
        argumentsEnd + int64_t(sizeof(warp::SumDescriptor) * sums.size());
    for (warp::AccessOp op : uses.sums)
      if (sumWidth(op) == width) {
        op->setAttr(warp::attr::update,
                    warp::UpdateAttr::get(context(), warp::UpdateScope::thread,
                                          /*run=*/0, place));
        any = true;
      }
    if (any)
      sums.push_back(entry(width));
  }
}

void ExactUpdates::visit(BlockArgument array, int64_t descriptor) {
  Type element = cast<warp::ArrayType>(array.getType()).getElementType();
  Uses data, gradients;
  data.collect(array);
  record(data, descriptor, /*gradient=*/false, element, 1);
  for (Operation *user : array.getUsers())
    if (isa<warp::GradOp>(user)) {
      gradients.collect(user->getResult(0));
      Type type = user->getResult(0).getType();
      element = cast<warp::ArrayType>(type).getElementType();
    }
  int64_t size = warp::getByteSize(
      cast<warp::ArrayType>(array.getType()).getElementType());
  record(gradients, descriptor, /*gradient=*/true, element,
         warp::getByteSize(element) / size);
}

void ExactUpdates::run() {
  SmallVector<Type> types(kernel.getArgumentTypes());
  if (auto declared = kernel->getAttrOfType<ArrayAttr>(warp::attr::argTypes)) {
    auto values = declared.getAsValueRange<TypeAttr>();
    types.assign(values.begin(), values.end());
  }
  warp::ParameterLayout layout = warp::layOutParameters(types);
  argumentsEnd = layout.size;
  SmallVector<warp::Leaf> leaves;
  for (auto [type, offset] : llvm::zip_equal(types, layout.offsets))
    warp::collectLeaves(type, offset, leaves);
  for (auto [argument, leaf] : llvm::zip(kernel.getArguments(), leaves))
    if (isa<warp::ArrayType>(argument.getType()))
      visit(argument, leaf.offset);
  if (sums.empty())
    return;
  Builder b(context());
  llvm::append_range(sums, accessed);
  warp::setSchedule(kernel,
                    warp::getSchedule(kernel).withSums(b.getArrayAttr(sums)));
}

void warp::markExactUpdates(FunctionOpInterface kernel) {
  if (getVariant(kernel).hasExactSums())
    ExactUpdates(kernel).run();
}
