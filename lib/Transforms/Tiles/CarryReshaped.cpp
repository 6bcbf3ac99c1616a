//===- CarryReshaped.cpp - Shapes of carried tiles ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A variable keeps the shape that it had first, so a tile that a loop changes
// through a view, as `s = tile_reshape(t, ...); s += ...` with `t` from before,
// is reshaped at the begin of each iteration and back at its end. A view that
// leaves the block that it is in has to be kept, which copies it: twice in an
// iteration here, and once more where branches meet. If all uses of what loops
// and branches carry together are views of one shape, and so is something that
// they are given, they carry that shape:
//
//   for iter_args(%s: tile<784>)            for iter_args(%m: tile<28x28>)
//     %m = tile_reshape %s             =>     %n = tile_map(%m, ...)
//     %n = tile_map(%m, ...)                  yield %n
//     yield tile_reshape %n
//
//===----------------------------------------------------------------------===//

#include "CarryReshaped.h"

#include "TileBuffers.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

namespace {

/// A tile that a loop or branch carries: an argument of a block, or a result.
struct Carried {
  Value value;
  /// An operand that gives it.
  OpOperand *from;
  /// True if that is from before a loop.
  bool isInit;
};

class ShapeCarrier {
public:
  explicit ShapeCarrier(FunctionOpInterface kernel) : kernel(kernel) {}
  void run();

private:
  void add(Value value, OpOperand &from, bool isInit = false);
  void tie(Value a, Value b) {
    classes.unionSets(a.getAsOpaquePointer(), b.getAsOpaquePointer());
  }
  void collect(Operation *op);
  bool isBetween(OpOperand &use) const { return between.contains(&use); }
  TileType shapeOf(ArrayRef<Carried> members) const;

  FunctionOpInterface kernel;
  SmallVector<Carried> all;
  llvm::EquivalenceClasses<void *> classes;
  /// Operands by which loops and branches pass tiles on.
  llvm::DenseSet<OpOperand *> between;
};

} // namespace

void ShapeCarrier::add(Value value, OpOperand &from, bool isInit) {
  if (!isTile(value))
    return;
  all.push_back({value, &from, isInit});
  classes.insert(value.getAsOpaquePointer());
  if (!isInit)
    between.insert(&from);
}

void ShapeCarrier::collect(Operation *op) {
  if (auto loop = dyn_cast<scf::ForOp>(op)) {
    for (unsigned i = 0; i < loop.getNumResults(); ++i) {
      Value argument = loop.getRegionIterArg(i);
      add(argument, loop.getInitArgsMutable()[i], /*isInit=*/true);
      OpOperand &next = loop.getBody()->getTerminator()->getOpOperand(i);
      add(argument, next);
      add(loop.getResult(i), next);
      if (isTile(argument))
        tie(argument, loop.getResult(i));
    }
  } else if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    for (unsigned i = 0; i < loop.getInits().size(); ++i) {
      Value argument = loop.getBeforeArguments()[i];
      add(argument, loop.getInitsMutable()[i], /*isInit=*/true);
      add(argument, loop.getYieldOp()->getOpOperand(i));
    }
    for (unsigned i = 0; i < loop.getNumResults(); ++i) {
      OpOperand &passed = loop.getConditionOp().getArgsMutable()[i];
      add(loop.getAfterArguments()[i], passed);
      add(loop.getResult(i), passed);
    }
  } else if (auto branch = dyn_cast<scf::IfOp>(op)) {
    for (unsigned i = 0; i < branch.getNumResults(); ++i)
      for (Block *block : {branch.thenBlock(), branch.elseBlock()})
        add(branch.getResult(i), block->getTerminator()->getOpOperand(i));
  }
}

/// The shape in which all that is carried together is used, and something of it
/// is given; null if there is none.
TileType ShapeCarrier::shapeOf(ArrayRef<Carried> members) const {
  TileType shape;
  for (const Carried &member : members)
    if (auto view = member.from->get().getDefiningOp<TileReshapeOp>();
        view && !member.isInit)
      shape = tileType(view.getTile());
  bool fits =
      shape && llvm::all_of(members, [&](const Carried &member) {
        return llvm::all_of(member.value.getUses(), [&](OpOperand &use) {
          return isBetween(use) ||
                 (isa<TileReshapeOp>(use.getOwner()) &&
                  use.getOwner()->getResult(0).getType() == shape);
        });
      });
  return fits ? shape : TileType();
}

/// Has an operand give a tile in another shape.
static void reshape(OpOperand &operand, TileType shape) {
  Value tile = operand.get();
  if (tile.getType() == shape)
    return;
  auto view = tile.getDefiningOp<TileReshapeOp>();
  if (view && view.getTile().getType() == shape) {
    operand.set(view.getTile());
    if (view->use_empty())
      view.erase();
    return;
  }
  OpBuilder b(operand.getOwner());
  operand.set(TileReshapeOp::create(b, tile.getLoc(), shape, tile));
}

void ShapeCarrier::run() {
  kernel->walk([&](Operation *op) { collect(op); });
  // Tiles that are passed on belong together, those that a loop begins with
  // do not.
  for (const Carried &one : all) {
    Value given = one.from->get();
    if (!one.isInit &&
        classes.findLeader(given.getAsOpaquePointer()) != classes.member_end())
      tie(one.value, given);
  }
  llvm::MapVector<void *, SmallVector<Carried>> members;
  for (const Carried &one : all)
    members[*classes.findLeader(one.value.getAsOpaquePointer())].push_back(one);
  for (auto &[leader, list] : members) {
    TileType shape = shapeOf(list);
    if (!shape)
      continue;
    for (Carried &member : list)
      member.value.setType(shape);
    for (const Carried &member : list) {
      reshape(*member.from, shape);
      for (Operation *user :
           llvm::make_early_inc_range(member.value.getUsers()))
        if (isa<TileReshapeOp>(user)) {
          user->replaceAllUsesWith(ValueRange(member.value));
          user->erase();
        }
    }
  }
}

void carryReshaped(FunctionOpInterface kernel) { ShapeCarrier(kernel).run(); }

} // namespace warp::tiles
