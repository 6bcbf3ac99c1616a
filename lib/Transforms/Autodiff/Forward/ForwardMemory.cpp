//===- ForwardMemory.cpp - Tangents of arrays -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Forward.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

namespace warp::autodiff {

Value ForwardBuilder::viewTwin(Operation *clone, Value twin) {
  Operation *view = clone->clone();
  view->setOperand(0, twin);
  view->getResult(0).setType(getTangentType(clone->getResult(0).getType()));
  builder.insert(view);
  return view->getResult(0);
}

/// The tangents of what lies at an address: one array after the other, or none
/// where the first one's address is 0.
Value ForwardBuilder::twinAt(ArrayAtOp clone, unsigned direction) {
  Location loc = clone.getLoc();
  auto type = cast<ArrayType>(getTangentType(clone.getType()));
  Value address = clone.getGrad();
  if (direction > 0) {
    Type wide = address.getType();
    int64_t bytes = direction * getByteSize(type.getElementType());
    Value offset = ConstantOp::create(builder, loc,
                                      builder.getIntegerAttr(wide, bytes));
    auto compute = [&](StringRef name, Value a, Value b) {
      return createBuiltin(builder, loc, name, {a, b})->getResult(0);
    };
    for (Value extent : clone.getExtents())
      offset = compute("mul", offset,
                       CastOp::create(builder, loc, wide, extent));
    address = ifThere(builder, loc, address, wide,
                      [&] { return compute("add", address, offset); });
  }
  return ArrayAtOp::create(builder, loc, type, address, clone.getExtents());
}

/// The same access of a twin: `tangent`, if any, is written.
Operation *ForwardBuilder::accessTwin(Operation *clone, Value twin,
                                      Value tangent) {
  auto access = cast<AccessOp>(clone->clone());
  access.getArrayMutable().assign(twin);
  if (tangent)
    access->setOperand(access.getWritten().getBeginOperandIndex(), tangent);
  for (Value result : access.getRead())
    result.setType(cast<ArrayType>(twin.getType()).getElementType());
  builder.insert(access);
  return access;
}

LogicalResult ForwardBuilder::runAccess(AccessOp op, Operation *clone,
                                        TangentMap &tangents) {
  Value twin = tangents.lookup(op.getArray());
  // Integers have no tangent.
  bool writesIntegers =
      op.mayWrite() && !differentialType(op.getWritten().front().getType());
  if (!twin || writesIntegers)
    return success();
  if (op.mayWrite() && failed(checkAddress(op)))
    return failure();
  switch (op.getEffect()) {
  case AccessEffect::Read:
    if (Type type = differentialType(op.getRead().front().getType())) {
      auto read = [&] { return accessTwin(clone, twin, {})->getResult(0); };
      auto at = rootOf(twin).getDefiningOp<ArrayAtOp>();
      tangents[op.getRead().front()] =
          at ? ifThere(builder, op.getLoc(), at.getAddress(), type, read)
             : Value(read());
    }
    return success();
  case AccessEffect::Write:
    accessTwin(clone, twin,
               getTangentOrZero(op.getWritten().front(), tangents));
    return success();
  case AccessEffect::Update:
    return runUpdate(op, clone, tangents);
  }
  llvm_unreachable("unknown effect");
}

/// The old value has the tangent that the twin had.
LogicalResult ForwardBuilder::runUpdate(AccessOp op, Operation *clone,
                                        TangentMap &tangents) {
  Location loc = op.getLoc();
  Value twin = tangents.lookup(op.getArray());
  Value value = op.getWritten().front();
  std::optional<AtomicKind> kind = op.getCombination();
  if (!kind)
    return op->emitError("'")
           << op->getName().stripDialect()
           << "' has no tangent, because its result depends on the order of "
              "threads";
  if (op.getRead().empty() && !tangents.lookup(value))
    return success();
  Value tangent = getTangentOrZero(value, tangents);
  if (kind == AtomicKind::add || kind == AtomicKind::sub ||
      kind == AtomicKind::exch) {
    Operation *update = accessTwin(clone, twin, tangent);
    for (auto [old, of] : llvm::zip_equal(op.getRead(), update->getResults()))
      tangents[old] = of;
    return success();
  }
  if (kind != AtomicKind::min && kind != AtomicKind::max)
    return op->emitError("this atomic has no tangent; use 'atomic_add', "
                         "'atomic_min', 'atomic_max' or 'atomic_exch'");
  // The value and its tangent are two updates, and other threads could come
  // between them.
  dual->setAttr(attr::oneThread,
                builder.getStringAttr("an atomic minimum or maximum has to "
                                      "keep its tangent with it"));
  Type type = cast<ArrayType>(twin.getType()).getElementType();
  ValueRange indices = cast<AccessOp>(clone).getIndices();
  Value before = LoadOp::create(builder, loc, type, twin, indices);
  tangents[op.getRead().front()] = before;
  auto builtin = [&](StringRef name, ValueRange operands) {
    return createBuiltin(builder, loc, name, operands)->getResult(0);
  };
  Value added = clone->getOperand(0), old = clone->getResult(0);
  Value replaces =
      builtin(kind == AtomicKind::min ? "lt" : "gt", {added, old});
  if (isa<FloatType>(added.getType()))
    replaces = builtin("where", {builtin("isnan", old),
                                 builtin("eq", {added, added}), replaces});
  Value kept = builtin("where", {replaces, tangent, before});
  StoreOp::create(builder, loc, kept, twin, indices);
  return success();
}

std::optional<LogicalResult> ForwardBuilder::runMemory(Operation *op,
                                                       Operation *clone,
                                                       TangentMap &tangents) {
  Location loc = op->getLoc();
  auto twinOf = [&](Value array) { return tangents.lookup(array); };
  auto setTangent = [&](Value tangent) {
    tangents[op->getResult(0)] = tangent;
  };
  ValueRange operands = clone->getOperands();
  return llvm::TypeSwitch<Operation *, std::optional<LogicalResult>>(op)
      .Case<ArrayViewOp, GradOp>([&](auto view) {
        Value twin = twinOf(view.getArray());
        if (twin && getTangentType(view->getResult(0).getType()))
          setTangent(viewTwin(clone, twin));
        return success();
      })
      .Case([&](ArrayAtOp at) {
        if (at.getGrad())
          setTangent(twinAt(cast<ArrayAtOp>(clone),
                            &tangents - directions.data()));
        return success();
      })
      .Case([&](StructGetOp get) {
        if (isa<ArrayType>(get.getType()))
          for (unsigned leaf : leaves.of(get.getResult()))
            if (!twins[leaf].empty())
              setTangent(twins[leaf][&tangents - directions.data()]);
        return success();
      })
      .Case([&](AccessOp access) { return runAccess(access, clone, tangents); })
      .Case([&](ScratchOp scratch) {
        if (varied.contains(scratch.getResult()))
          setTangent(ScratchOp::create(builder, loc,
                                       getTangentType(scratch.getType())));
        return success();
      })
      .Case([&](ScratchLoadOp load) {
        if (Value twin = twinOf(load.getScratch()))
          setTangent(ScratchLoadOp::create(
              builder, loc, getTangentType(load.getType()), twin, operands[1]));
        return success();
      })
      .Case([&](ScratchStoreOp store) {
        if (Value twin = twinOf(store.getScratch()))
          ScratchStoreOp::create(builder, loc,
                                 getTangentOrZero(store.getValue(), tangents),
                                 twin, operands[2]);
        return success();
      })
      .Default([](Operation *) { return std::nullopt; });
}

} // namespace warp::autodiff
