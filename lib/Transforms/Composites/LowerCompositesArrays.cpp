//===- LowerCompositesArrays.cpp - Array accesses and output --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An access becomes one operation on all components of the element, so that
// no later pass separates them. Views and thread indices keep their operation;
// only integers change. An index is `i32` where it fits that as a signed
// number, otherwise `i64`.
//
//===----------------------------------------------------------------------===//

#include "LowerComposites.h"

#include "Lowerings/Lowerings.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;
using namespace warp::lowering;

namespace warp {

Value CompositeLowering::getIndex(Value index) {
  Scalar x = getScalar(index);
  MLIRContext *context = index.getContext();
  if (isa<IndexType>(x.type))
    return convert(x, IntegerType::get(context, 64)).value;
  bool fits = x.getWidth() < 32 || (x.getWidth() == 32 && !x.isUnsigned());
  return convert(x,
                 IntegerType::get(context, fits ? 32 : 64, IntegerType::Signed))
      .value;
}

/// The promotion of a number by C's variable arguments.
static Value promote(Scalar x) {
  MLIRContext *context = x.type.getContext();
  if (x.isFloat())
    return convert(x, Float64Type::get(context)).value;
  if (x.getWidth() >= 32)
    return x.value;
  return convert(x, IntegerType::get(context, 32, IntegerType::Signed)).value;
}

/// Each component gets memory of its own: an optimiser takes apart only what
/// it can name.
void CompositeLowering::lowerScratch(ScratchOp op) {
  auto type = cast<ScratchType>(op.getType());
  SmallVector<Value> parts;
  for (Type part : flattenToThreadTypes(type.getElementType()))
    parts.push_back(ScratchOp::create(
        emitter.builder, op.getLoc(),
        ScratchType::get(part.getContext(), type.getSlots(), part)));
  map(op, parts);
  dead.push_back(op);
}

void CompositeLowering::lowerScratch(ScratchLoadOp op) {
  Value index = getIndex(op.getIndex());
  SmallVector<Value> parts;
  for (Value scratch : SmallVector<Value>(lookup(op.getScratch()))) {
    Type part = cast<ScratchType>(scratch.getType()).getElementType();
    auto made = ScratchLoadOp::create(emitter.builder, op.getLoc(), part,
                                      scratch, index);
    if (Attribute fact = op->getAttr(attr::nonNegative))
      made->setAttr(attr::nonNegative, fact);
    parts.push_back(made);
  }
  replace(op, ValueRange(parts));
}

void CompositeLowering::lowerScratch(ScratchStoreOp op) {
  Value index = getIndex(op.getIndex());
  SmallVector<Value> values(lookup(op.getValue()));
  SmallVector<Value> parts(lookup(op.getScratch()));
  for (auto [value, scratch] : llvm::zip_equal(values, parts))
    ScratchStoreOp::create(emitter.builder, op.getLoc(), value, scratch, index);
  dead.push_back(op);
}

std::optional<LogicalResult> CompositeLowering::lowerArrayOp(Operation *op) {
  OpBuilder &builder = emitter.builder;
  auto indicesOf = [&](ValueRange indices) {
    return llvm::map_to_vector(indices, [&](Value i) { return getIndex(i); });
  };
  auto done = [&](auto built) {
    replace(op, ValueRange(built->getResults()));
    return std::optional(success());
  };
  auto keep = [&](ArrayRef<Value> operands) {
    rebuild(op, operands);
    return std::optional(success());
  };

  return llvm::TypeSwitch<Operation *, std::optional<LogicalResult>>(op)
      .Case([&](LoadOp load) {
        return done(LoadComponentsOp::create(
            builder, load.getLoc(), flattenToThreadTypes(load.getType()),
            lookupOne(load.getArray()), indicesOf(load.getIndices())));
      })
      .Case([&](StoreOp store) {
        SmallVector<Value> components(lookup(store.getValue()));
        return done(StoreComponentsOp::create(
            builder, store.getLoc(), components, lookupOne(store.getArray()),
            indicesOf(store.getIndices())));
      })
      .Case([&](AtomicOp atomic) {
        SmallVector<Value> components(lookup(atomic.getValue()));
        return done(AtomicComponentsOp::create(
            builder, atomic.getLoc(), flattenToThreadTypes(atomic.getType()),
            atomic.getKind(), components, lookupOne(atomic.getArray()),
            indicesOf(atomic.getIndices())));
      })
      .Case([&](AtomicCasOp cas) {
        SmallVector<Value> operands = {lookupOne(cas.getExpected()),
                                       lookupOne(cas.getValue()),
                                       lookupOne(cas.getArray())};
        operands.append(indicesOf(cas.getIndices()));
        return keep(operands);
      })
      .Case<ViewOp, ComponentViewOp>([&](auto view) {
        SmallVector<Value> operands = {lookupOne(view.getArray())};
        operands.append(indicesOf(view.getIndices()));
        return keep(operands);
      })
      .Case([&](IndexDimOp view) {
        return keep({lookupOne(view.getArray()), getIndex(view.getIndex())});
      })
      .Case([&](CheckIndexOp check) {
        return keep(indicesOf(check.getIndices()));
      })
      .Case([&](SliceOp slice) {
        return keep({lookupOne(slice.getArray()), getIndex(slice.getStart()),
                     getIndex(slice.getStop()), getIndex(slice.getStep())});
      })
      .Case([&](ArrayAtOp array) {
        // Derivatives have been made.
        array.getGradMutable().clear();
        return keep(lookup(array->getOperands()));
      })
      .Case<DimOp, StrideOp, PointerOp, GradOp, TidOp, AssertOp, LibraryCallOp,
            BarrierOp, ThreadNumberOp, BlockMemoryOp, LaunchExtentOp>(
          [&](Operation *op) { return keep(lookup(op->getOperands())); })
      .Case([&](PrintfOp print) {
        return keep(llvm::map_to_vector(
            print.getArgs(), [&](Value x) { return promote(getScalar(x)); }));
      })
      .Case<ScratchOp, ScratchLoadOp, ScratchStoreOp>([&](auto scratch) {
        lowerScratch(scratch);
        return std::optional(success());
      })
      .Default([](Operation *) { return std::nullopt; });
}

} // namespace warp
