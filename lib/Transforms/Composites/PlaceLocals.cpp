//===- PlaceLocals.cpp - Stack placement of composites --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Composites are values, and a component at an index known only at run time is
// selected among all of them. Where they are many, memory of the thread takes
// the place of the value: an insertion stores, an extraction loads, and what
// loops carried stays where it is. `LocalWebs` says which values share one
// memory and where one has to be copied. The copies that an adjoint keeps of
// such values lies in one piece, of which it loads the components that it
// needs.
//
//===----------------------------------------------------------------------===//

#include "PlaceLocals.h"

#include "LocalMemory.h"
#include "LocalWebs.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

namespace {

class PlaceLocals {
public:
  explicit PlaceLocals(FunctionOpInterface function)
      : entry(function.getFunctionBody().front()), memory(entry),
        webs(function) {}

  void run();

private:
  void collectTables();
  bool isWorthPacking(warp::ScratchOp scratch);
  void pack(warp::ScratchOp scratch);
  void handOn(const warp::LocalEdge &edge);
  void store(Value composite, warp::Stored to);
  void replaceUses(Value composite, warp::Stored where);
  void placeTable(Value composite);
  void forget();

  Block &entry;
  warp::LocalMemory memory;
  warp::LocalWebs webs;
  /// The memory of webs, and of what was loaded of packed memory.
  llvm::DenseMap<Value, warp::Stored> places;
  llvm::DenseSet<OpOperand *> handedOn;
  SmallVector<Value> tables, loaded;
  SmallVector<Operation *> dead;
};

} // namespace

//===----------------------------------------------------------------------===//
// Versions
//===----------------------------------------------------------------------===//

void PlaceLocals::store(Value composite, warp::Stored to) {
  Value key = webs.isPlaced(composite) ? webs.getWeb(composite) : composite;
  warp::Stored from = places.lookup(key);
  if (!from)
    memory.fill(composite, to);
  else if (!(from == to))
    memory.copy(composite.getType(), from, to);
}

void PlaceLocals::handOn(const warp::LocalEdge &edge) {
  handedOn.insert(edge.source);
  warp::Stored to = places.lookup(webs.getWeb(edge.targets.front()));
  memory.moveTo(edge.source->getOwner());
  store(edge.source->get(), to);
  if (auto insert = dyn_cast<warp::InsertOp>(edge.source->getOwner()))
    memory.store(insert, to);
}

/// Extractions load; any other operation gets the whole value.
void PlaceLocals::replaceUses(Value composite, warp::Stored where) {
  for (OpOperand &use : llvm::make_early_inc_range(composite.getUses())) {
    if (handedOn.contains(&use))
      continue;
    memory.moveTo(use.getOwner());
    if (auto extract = dyn_cast<warp::ExtractOp>(use.getOwner())) {
      extract.replaceAllUsesWith(memory.load(extract, where));
      extract.erase();
    } else {
      use.set(memory.load(composite.getType(), where));
    }
  }
}

/// Nothing is carried any more: a constant takes the place of what was, which
/// canonicalisation removes.
void PlaceLocals::forget() {
  memory.moveTo(&entry.front());
  Value nothing = arith::ConstantOp::create(memory.b, entry.front().getLoc(),
                                            memory.b.getBoolAttr(false));
  for (Value version : webs.getVersions())
    if (!version.getDefiningOp<warp::InsertOp>())
      version.setType(nothing.getType());
  for (const warp::LocalEdge &edge : webs.getEdges()) {
    Operation *op = edge.source->getOwner();
    edge.source->set(nothing);
    if (isa<warp::InsertOp>(op))
      dead.push_back(op);
  }
  for (Operation *op : dead)
    op->dropAllReferences();
  for (Operation *op : dead)
    op->erase();
}

//===----------------------------------------------------------------------===//
// Values that are indexed and never changed
//===----------------------------------------------------------------------===//

void PlaceLocals::collectTables() {
  auto collect = [&](Value value) {
    if (warp::isLongComposite(value.getType()) && !webs.isPlaced(value) &&
        !value.getDefiningOp<warp::InsertOp>() &&
        !value.getDefiningOp<warp::ScratchLoadOp>() &&
        warp::hasDynamicAccess(value))
      tables.push_back(value);
  };
  llvm::for_each(entry.getArguments(), collect);
  entry.getParentOp()->walk([&](Operation *op) {
    if (!op->getNumRegions())
      llvm::for_each(op->getResults(), collect);
  });
}

void PlaceLocals::placeTable(Value composite) {
  warp::Stored place = memory.allocate(composite.getType());
  memory.moveAfter(composite);
  if (isa<BlockArgument>(composite))
    memory.moveTo(place.memory.getDefiningOp()->getNextNode());
  memory.fill(composite, place);
  for (Operation *user : llvm::make_early_inc_range(composite.getUsers()))
    if (auto extract = dyn_cast<warp::ExtractOp>(user);
        extract && warp::isDynamic(extract.getIndices())) {
      memory.moveTo(extract);
      extract.replaceAllUsesWith(memory.load(extract, place));
      extract.erase();
    }
}

//===----------------------------------------------------------------------===//
// Values that adjoints keep
//===----------------------------------------------------------------------===//

bool PlaceLocals::isWorthPacking(warp::ScratchOp scratch) {
  auto type = cast<warp::ScratchType>(scratch.getType());
  if (!warp::isLongComposite(type.getElementType()) ||
      type.getSlots() * warp::getComponentCount(type.getElementType()) > 65536)
    return false;
  return llvm::any_of(scratch->getUsers(), [&](Operation *user) {
    if (auto store = dyn_cast<warp::ScratchStoreOp>(user))
      return webs.isPlaced(store.getValue());
    return warp::hasDynamicAccess(user->getResult(0));
  });
}

/// True if memory holds, where a value is used, what it held where the value
/// was loaded.
static bool isKept(warp::ScratchLoadOp load) {
  llvm::SmallPtrSet<Operation *, 8> uses;
  for (Operation *user : load->getUsers()) {
    Operation *here = load->getBlock()->findAncestorOpInBlock(*user);
    uses.insert(here);
  }
  auto isStore = [&](Operation *op) {
    auto store = dyn_cast<warp::ScratchStoreOp>(op);
    return store && store.getScratch() == load.getScratch()
               ? WalkResult::interrupt()
               : WalkResult::advance();
  };
  for (Operation *op = load; !uses.empty() && op; op = op->getNextNode()) {
    // A store into this memory may be the last use, if it is no loop.
    if (uses.erase(op) && uses.empty() && !op->getNumRegions())
      return true;
    if (op->walk(isStore).wasInterrupted())
      return false;
  }
  return true;
}

void PlaceLocals::pack(warp::ScratchOp scratch) {
  auto whole = cast<warp::ScratchType>(scratch.getType());
  Type type = whole.getElementType();
  warp::Stored all = memory.allocate(type, whole.getSlots());
  for (Operation *user : scratch->getUsers()) {
    memory.moveTo(user);
    if (auto load = dyn_cast<warp::ScratchLoadOp>(user)) {
      warp::Stored place = memory.at(all, type, load.getIndex());
      if (!isKept(load)) {
        warp::Stored own = memory.allocate(type);
        memory.copy(type, place, own);
        place = own;
      }
      places[load] = place;
      loaded.push_back(load);
    }
    dead.push_back(user);
  }
  dead.push_back(scratch);
  places[scratch] = all;
}

//===----------------------------------------------------------------------===//
// All
//===----------------------------------------------------------------------===//

void PlaceLocals::run() {
  collectTables();
  SmallVector<warp::ScratchOp> packed;
  entry.getParentOp()->walk([&](warp::ScratchOp scratch) {
    if (isWorthPacking(scratch))
      packed.push_back(scratch);
  });
  if (tables.empty() && packed.empty() && webs.getVersions().empty())
    return;
  memory.moveTo(&entry.front());
  for (Value version : webs.getVersions())
    if (warp::Stored &place = places[webs.getWeb(version)]; !place)
      place = memory.allocate(version.getType());
  for (warp::ScratchOp scratch : packed)
    pack(scratch);
  for (const warp::LocalEdge &edge : webs.getEdges())
    handOn(edge);
  for (warp::ScratchOp scratch : packed)
    for (Operation *user : scratch->getUsers())
      if (auto store = dyn_cast<warp::ScratchStoreOp>(user)) {
        memory.moveTo(store);
        warp::Stored all = places.lookup(scratch);
        this->store(store.getValue(), memory.at(all, store.getValue().getType(),
                                                store.getIndex()));
        handedOn.insert(&store.getValueMutable());
      }
  for (Value version : webs.getVersions())
    replaceUses(version, places.lookup(webs.getWeb(version)));
  for (Value value : loaded)
    replaceUses(value, places.lookup(value));
  llvm::for_each(tables, [&](Value value) { placeTable(value); });
  forget();
}

void warp::placeLocals(FunctionOpInterface function) {
  addInPlace(function);
  readNewest(function);
  PlaceLocals(function).run();
}
