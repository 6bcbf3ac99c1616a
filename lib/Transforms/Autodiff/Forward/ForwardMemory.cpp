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

/// The old value of an atomic has the tangent that the twin had.
LogicalResult ForwardBuilder::runAtomic(AtomicOp op, Operation *clone,
                                        TangentMap &tangents) {
  Location loc = op.getLoc();
  Value twin = tangents.lookup(op.getArray());
  Type type = cast<ArrayType>(twin.getType()).getElementType();
  ValueRange indices = clone->getOperands().drop_front(2);
  Value tangent = getTangentOrZero(op.getValue(), tangents);
  auto update = [&](AtomicKind kind) -> Value {
    return AtomicOp::create(builder, loc, type, kind, tangent, twin, indices);
  };
  AtomicKind kind = op.getKind();
  if (kind == AtomicKind::add || kind == AtomicKind::sub ||
      kind == AtomicKind::exch) {
    tangents[op.getOld()] = update(kind);
    return success();
  }
  if (kind != AtomicKind::min && kind != AtomicKind::max)
    return op.emitError("this atomic has no tangent; use 'atomic_add', "
                        "'atomic_min', 'atomic_max' or 'atomic_exch'");
  // The value and its tangent are two updates, and other threads could come
  // between them.
  dual->setAttr(attr::oneThread,
                builder.getStringAttr("an atomic minimum or maximum has to "
                                      "keep its tangent with it"));
  tangents[op.getOld()] = LoadOp::create(builder, loc, type, twin, indices);
  Value replaces =
      createBuiltin(builder, loc, kind == AtomicKind::min ? "lt" : "gt",
                    {clone->getOperand(0), clone->getResult(0)})
          ->getResult(0);
  Value kept = createBuiltin(builder, loc, "where",
                             {replaces, tangent, tangents[op.getOld()]})
                   ->getResult(0);
  StoreOp::create(builder, loc, kept, twin, indices);
  return success();
}

std::optional<LogicalResult>
ForwardBuilder::runMemory(Operation *op, Operation *clone,
                          TangentMap &tangents) {
  Location loc = op->getLoc();
  auto twinOf = [&](Value array) { return tangents.lookup(array); };
  auto elementOf = [](Value twin) {
    return cast<ArrayType>(twin.getType()).getElementType();
  };
  auto setTangent = [&](Value tangent) {
    tangents[op->getResult(0)] = tangent;
  };
  ValueRange operands = clone->getOperands();
  return llvm::TypeSwitch<Operation *, std::optional<LogicalResult>>(op)
      .Case<ViewOp, SliceOp, ComponentViewOp, GradOp>([&](auto view) {
        Value twin = twinOf(view.getArray());
        if (twin && getTangentType(view.getType()))
          setTangent(viewTwin(clone, twin));
        return success();
      })
      .Case([&](StructGetOp get) {
        if (isa<ArrayType>(get.getType()))
          for (unsigned leaf : leaves.of(get.getResult()))
            if (!twins[leaf].empty())
              setTangent(twins[leaf][&tangents - directions.data()]);
        return success();
      })
      .Case([&](LoadOp load) {
        Value twin = twinOf(load.getArray());
        if (twin && differentialType(load.getType()))
          setTangent(LoadOp::create(builder, loc, elementOf(twin), twin,
                                    operands.drop_front(1)));
        return success();
      })
      .Case([&](StoreOp store) {
        if (Value twin = twinOf(store.getArray()))
          StoreOp::create(builder, loc,
                          getTangentOrZero(store.getValue(), tangents), twin,
                          operands.drop_front(2));
        return success();
      })
      .Case([&](AccumulateOp accumulate) {
        Value twin = twinOf(accumulate.getArray());
        Value tangent = tangents.lookup(accumulate.getValue());
        if (twin && tangent)
          AccumulateOp::create(builder, loc, tangent, twin,
                               operands.drop_front(2),
                               accumulate.getUniqueAttr());
        return success();
      })
      .Case([&](AtomicOp atomic) -> LogicalResult {
        return twinOf(atomic.getArray()) ? runAtomic(atomic, clone, tangents)
                                         : success();
      })
      .Case([&](AtomicCasOp cas) -> LogicalResult {
        if (!twinOf(cas.getArray()))
          return success();
        return cas.emitError("'atomic_cas' has no tangent, because its result "
                             "depends on the order of threads");
      })
      .Case([&](ScratchOp scratch) {
        if (varied.contains(scratch.getResult()))
          setTangent(ScratchOp::create(builder, loc,
                                       getTangentType(scratch.getType())));
        return success();
      })
      .Case([&](ScratchLoadOp load) {
        if (Value twin = twinOf(load.getScratch()))
          setTangent(ScratchLoadOp::create(builder, loc,
                                           getTangentType(load.getType()), twin,
                                           operands[1]));
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
