//===- JoinFields.cpp - Fields of an element in one load ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint loads the fields of a struct that it needs one by one, and lanes
// gather each number of them. A row of neighbouring numbers, which are
// transposed in registers, takes less time than a gather for each:
//
//     p = bodies.x[j]                  p, v, r, _ = bodies[j]
//     v = bodies.v[j]           =>
//     r = bodies.r[j]
//
// Loads are joined that nothing which writes to memory stands between, so it
// does not matter which arrays overlap.
//
//===----------------------------------------------------------------------===//

#include "JoinFields.h"

#include "LanePlan.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;

namespace {
/// A load of a field, and the number of its first component in the element.
struct FieldLoad {
  warp::LoadComponentsOp op;
  unsigned first;
};

/// Loads of fields of one element.
struct Element {
  Value array;
  OperandRange indices;
  SmallVector<FieldLoad, 4> loads;
};
} // namespace

static unsigned countComponents(Type type) {
  SmallVector<Type> components;
  warp::flatten(type, components);
  return components.size();
}

/// The array whose elements have the field that a view is of, and the number of
/// the field's first component; no array if it is not a field.
static std::pair<Value, unsigned> fieldOf(Value array) {
  auto view = array.getDefiningOp<warp::ComponentViewOp>();
  if (!view || !view.getField())
    return {};
  auto record = dyn_cast<warp::StructType>(
      cast<warp::ArrayType>(view.getArray().getType()).getElementType());
  if (!record || !warp::hasDenseElements(view.getArray()))
    return {};
  unsigned first = 0;
  for (int64_t i = 0, end = record.getFieldIndex(*view.getField()); i < end;
       ++i)
    first += countComponents(record.getFieldTypes()[i]);
  return {view.getArray(), first};
}

/// True if one load of the whole element takes less than those of its fields.
static bool isWorthIt(const Element &element) {
  unsigned loaded = 0;
  for (FieldLoad load : element.loads)
    loaded += load.op.getNumResults();
  Type type = cast<warp::ArrayType>(element.array.getType()).getElementType();
  return element.loads.size() > 1 && 2 * loaded >= countComponents(type);
}

static void join(const Element &element) {
  Operation *front = element.loads.front().op;
  OpBuilder b(front);
  SmallVector<Type> types;
  warp::flatten(cast<warp::ArrayType>(element.array.getType()).getElementType(),
                types);
  for (Type &type : types)
    type = warp::getSignless(type);
  auto whole = warp::LoadComponentsOp::create(b, front->getLoc(), types,
                                              element.array, element.indices);
  for (FieldLoad load : element.loads)
    load.op->replaceAllUsesWith(
        whole.getResults().slice(load.first, load.op.getNumResults()));
}

static bool mayWrite(Operation &op) {
  if (isMemoryEffectFree(&op) || isa<warp::ScratchStoreOp>(op))
    return false;
  if (op.getNumRegions() != 0)
    return llvm::any_of(op.getRegions(), [](Region &region) {
      return llvm::any_of(
          region, [](Block &block) { return llvm::any_of(block, mayWrite); });
    });
  return !hasSingleEffect<MemoryEffects::Read>(&op);
}

static void joinIn(Block &block) {
  SmallVector<Element> open;
  SmallVector<Operation *> joined;
  auto close = [&] {
    for (const Element &element : open)
      if (isWorthIt(element)) {
        join(element);
        for (FieldLoad load : element.loads)
          joined.push_back(load.op);
      }
    open.clear();
  };
  for (Operation &op : block) {
    auto load = dyn_cast<warp::LoadComponentsOp>(op);
    auto [array, first] =
        load ? fieldOf(load.getArray()) : std::pair<Value, unsigned>();
    if (!array) {
      if (mayWrite(op))
        close();
      continue;
    }
    auto known = llvm::find_if(open, [&, array = array](const Element &one) {
      return one.array == array && llvm::equal(one.indices, load.getIndices());
    });
    if (known == open.end()) {
      open.push_back({array, load.getIndices(), {}});
      known = std::prev(open.end());
    }
    known->loads.push_back({load, first});
  }
  close();
  for (Operation *op : joined)
    op->erase();
}

void warp::joinFields(FunctionOpInterface kernel) {
  SmallVector<Block *> blocks;
  kernel->walk([&](Block *block) { blocks.push_back(block); });
  for (Block *block : blocks)
    joinIn(*block);
}
