//===- GatherBuilder.cpp - Builder of gather kernels ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread has the element with its own index; no index is negative. A term
// that is added at an offset comes from the thread that is as far away, in the
// other direction; for each offset the code of the adjoint that leads to its
// sums is cloned with the index of that thread. All of it is one expression per
// gradient,
//
//   s = (c1 ? v1 : 0) + (c2 ? v2 : 0) + ...     if c1 or c2 or ...: g += s
//
// which has no branch but around loads, so that LLVM can vectorise it. The
// second condition is there because an element that no thread adds to may not
// even exist.
//
// Most threads are not at a border of the launch: all their terms are there, as
// far as it is about the dimensions before the last, in which the threads of a
// row agree. For them a short kernel has the terms once more, with a branch for
// all that are at the same distance in the last dimension:
//
//   inside:  s = (c1 ? v1 + v4 : 0) + (c2 ? v2 + v3 : 0)      else:  as above
//
//===----------------------------------------------------------------------===//

#include "GatherBuilder.h"

#include "Autodiff/DeadValues.h"
#include "Autodiff/Rules/Rules.h"
#include "GatherGuard.h"

#include "WarpDialect/Passes.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;
using namespace warp::autodiff;

namespace {

/// A sum as far as it has been built, and whether there was a term at all.
/// Null: no term; null `any` with a sum: certainly one.
struct Partial {
  Value sum, any;
};

class GatherBuilder : GatherEmitter {
public:
  GatherBuilder(func::FuncOp adjoint, ArrayRef<NeighborSums> gathers,
                const SumsByOffset &sums, unsigned rank)
      : GatherEmitter{
            OpBuilder(adjoint.getContext()), adjoint.getLoc(), {}, {}, {}},
        adjoint(adjoint), gathers(gathers), sums(sums), rank(rank) {}

  void build();

private:
  void createFunction();
  void setAttributes();
  Value shifted(unsigned dimension, int64_t offset);
  Value clone(Value value, IRMapping &map);
  void clone(Operation *op, IRMapping &map);
  void simplify(Operation *op);
  void addPartial(Partial &to, const Partial &from);
  using Group = ArrayRef<std::pair<unsigned, Operation *>>;
  void addValues(Group sums, IRMapping map, MutableArrayRef<Partial> partials);
  /// Sums of a block, which threads add where a guard holds.
  struct Term {
    Guard guard;
    Offsets back;
    IRMapping map;
    SmallVector<std::pair<unsigned, Operation *>> sums;
  };
  IRMapping mapAt(const Offsets &offsets);
  bool collect(Block &block, const Guard &guard, Group group, IRMapping map,
               std::vector<Term> &terms);
  bool isShort() const;
  Value isInside(ArrayRef<Term> terms);
  void addInside(ArrayRef<Term> terms);
  void addAnywhere();
  void addBlock(Block &block, const Guard &guard, Group group, IRMapping map,
                MutableArrayRef<Partial> partials);
  void addBranch(scf::IfOp branch, const Guard &guard, Group group,
                 IRMapping map, MutableArrayRef<Partial> partials);
  void addGuarded(Value guard, MutableArrayRef<Partial> partials,
                  function_ref<void(MutableArrayRef<Partial>)> body);
  void store(const NeighborSums &all, const Partial &partial);
  void store(ArrayRef<Partial> partials);

  func::FuncOp adjoint;
  ArrayRef<NeighborSums> gathers;
  const SumsByOffset &sums;
  unsigned rank;
  func::FuncOp function;
  /// By how much the launch is larger.
  Offsets halo;
  /// From the thread that sums come from to this one.
  Offsets back;
  /// Values before all others, by what they are.
  std::map<std::pair<unsigned, int64_t>, Value> shifts;
  SmallVector<Value> extents;
  SmallVector<Operation *> clones;
  /// The end of what is the same in all threads.
  Operation *uniformEnd = nullptr;
  IRMapping uniform;
};

/// Operations of an adjoint whose terms a kernel may have twice.
constexpr int64_t mostTwice = 400;

} // namespace

void GatherBuilder::createFunction() {
  SmallVector<Type> types(adjoint.getArgumentTypes());
  Type index = IntegerType::get(b.getContext(), 32, IntegerType::Signed);
  types.append(rank, index);
  b.setInsertionPoint(adjoint);
  function = func::FuncOp::create(b, loc, (adjoint.getName() + "_sums").str(),
                                  b.getFunctionType(types, {}));
  Block *body = function.addEntryBlock();
  b.setInsertionPointToStart(body);
  llvm::append_range(extents, body->getArguments().take_back(rank));
  tid = warp::TidOp::create(b, loc, SmallVector<Type>(rank, index));
  uniformEnd = number(0).getDefiningOp();
  uniform.map(adjoint.getArguments(),
              function.getArguments().take_front(adjoint.getNumArguments()));
  makeUniform = [this](Value value) {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPoint(uniformEnd);
    return clone(value, uniform);
  };
  b.setInsertionPoint(func::ReturnOp::create(b, loc));
}

/// Names the parameters, and says by how much the launch is larger.
void GatherBuilder::setAttributes() {
  if (auto known = adjoint->getAttrOfType<ArrayAttr>(warp::attr::argNames)) {
    SmallVector<Attribute> names(known.begin(), known.end());
    for (unsigned i = 0; i < rank; ++i)
      names.push_back(b.getStringAttr("launch." + Twine(i)));
    function->setAttr(warp::attr::argNames, b.getArrayAttr(names));
  }
  function->setAttr(warp::attr::halo, b.getDenseI64ArrayAttr(halo));
  if (Attribute primal = adjoint->getAttr(warp::attr::primal))
    function->setAttr(warp::attr::primal, primal);
}

/// A thread index plus a constant.
Value GatherBuilder::shifted(unsigned dimension, int64_t offset) {
  Value &found = shifts[{dimension, offset}];
  if (found)
    return found;
  Value index = tid.getResult(dimension);
  if (offset == 0)
    return found = index;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfter(tid);
  Value distance = number(std::abs(offset));
  if (offset < 0)
    return found = make<warp::SubOp>(index.getType(), {index, distance});
  return found = make<warp::AddOp>(index.getType(), {index, distance});
}

//===----------------------------------------------------------------------===//
// Values of other threads
//===----------------------------------------------------------------------===//

/// Puts a sum of a thread index and constants, or a comparison of one, in terms
/// of this thread's own index. Guards of that form are what tells later passes
/// that an index is not negative.
void GatherBuilder::simplify(Operation *op) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPoint(op);
  Type type = extents.front().getType();
  if (isa<warp::AddOp, warp::SubOp>(op)) {
    Value sum = op->getResult(0);
    std::optional<Shift> shift = getShift(sum);
    if (shift && sum.getType() == type)
      sum.replaceAllUsesWith(shifted(shift->dimension, shift->offset));
  }
  if (!isa<warp::EqOp, warp::NeOp, warp::LtOp, warp::LeOp, warp::GtOp,
           warp::GeOp>(op))
    return;
  for (unsigned i : {0, 1}) {
    Value index = op->getOperand(i);
    auto bound = op->getOperand(1 - i).getDefiningOp<warp::ConstantOp>();
    std::optional<Shift> shift = getShift(index);
    if (!shift || !bound || index.getType() != type)
      continue;
    int64_t value = cast<IntegerAttr>(bound.getValue()).getInt();
    if (std::abs(value) > (1 << 30))
      continue;
    op->setOperand(i, tid.getResult(shift->dimension));
    op->setOperand(1 - i, number(value - shift->offset));
  }
}

/// Computes a value of the adjoint for the thread that `map` has for it.
Value GatherBuilder::clone(Value value, IRMapping &map) {
  if (!map.contains(value))
    clone(value.getDefiningOp(), map);
  return map.lookup(value);
}

void GatherBuilder::clone(Operation *op, IRMapping &map) {
  op->walk([&](Operation *inner) {
    for (Value operand : inner->getOperands())
      if (!op->isAncestor(operand.getParentRegion()->getParentOp()))
        clone(operand, map);
  });
  Operation *copy = b.clone(*op, map);
  copy->walk([&](Operation *inner) {
    if (inner != copy && hasOwnEffect(inner))
      inner->erase();
  });
  clones.push_back(copy);
}

//===----------------------------------------------------------------------===//
// Sums
//===----------------------------------------------------------------------===//

void GatherBuilder::addPartial(Partial &to, const Partial &from) {
  if (!from.sum)
    return;
  if (!to.sum) {
    to = from;
    return;
  }
  to.sum = add(b, loc, to.sum, from.sum);
  if (to.any && from.any)
    to.any = make<warp::BitOrOp>(b.getI1Type(), {to.any, from.any});
  else
    to.any = nullptr;
}

/// Adds what `body` adds where a guard holds.
void GatherBuilder::addGuarded(
    Value guard, MutableArrayRef<Partial> partials,
    function_ref<void(MutableArrayRef<Partial>)> body) {
  if (!guard)
    return body(partials);
  auto branch = scf::IfOp::create(b, loc, guard, /*withElseRegion=*/true);
  SmallVector<Partial> inner(partials.size());
  b.setInsertionPointToStart(branch.thenBlock());
  body(inner);
  SmallVector<Value> yields, none;
  for (Partial &partial : inner)
    for (Value value : {partial.sum, partial.any})
      if (value)
        yields.push_back(value);
  b.setInsertionPointToStart(branch.elseBlock());
  for (Value value : yields)
    none.push_back(value.getType().isInteger(1)
                       ? truth(false)
                       : zero(b, loc, value.getType()));
  branch.thenYield()->setOperands(yields);
  branch.elseYield()->setOperands(none);
  b.setInsertionPoint(branch);
  auto full = scf::IfOp::create(b, loc, TypeRange(ValueRange(yields)), guard,
                                /*addThenBlock=*/false, /*addElseBlock=*/false);
  full.getThenRegion().takeBody(branch.getThenRegion());
  full.getElseRegion().takeBody(branch.getElseRegion());
  branch.erase();
  b.setInsertionPointAfter(full);
  auto next = full.getResults().begin();
  for (auto [to, from] : llvm::zip_equal(partials, inner)) {
    if (!from.sum)
      continue;
    Value sum = *next++;
    addPartial(to, {sum, from.any ? Value(*next++) : guard});
  }
}

/// Adds the sums of a branch. A condition that can be had anywhere joins the
/// guard, so that there is one branch around the values.
void GatherBuilder::addBranch(scf::IfOp branch, const Guard &guard, Group group,
                              IRMapping map,
                              MutableArrayRef<Partial> partials) {
  auto addSides = [&](const Guard &outer, MutableArrayRef<Partial> to) {
    for (Block *side : {branch.thenBlock(), branch.elseBlock()}) {
      auto isIn = [&](auto &sum) {
        return side->findAncestorOpInBlock(*sum.second);
      };
      if (!side || llvm::none_of(group, isIn))
        continue;
      Guard inner = outer;
      inner.add(*this, branch.getCondition(), side == branch.thenBlock(),
                [&](Value value) { return clone(value, map); });
      addBlock(*side, inner, group, map, to);
    }
  };
  if (isSpeculatable(branch.getCondition()))
    return addSides(guard, partials);
  addGuarded(
      guard.build(*this, back, halo), partials,
      [&](MutableArrayRef<Partial> inner) { addSides(Guard(rank), inner); });
}

/// Adds what a thread sends.
void GatherBuilder::addValues(Group sums, IRMapping map,
                              MutableArrayRef<Partial> partials) {
  for (auto [number, op] : sums) {
    Value value = cast<warp::AccumulateOp>(op).getValue();
    addPartial(partials[number], {clone(value, map), nullptr});
  }
}

/// The sums of a group that a block makes itself, and the branches in it that
/// make others.
static std::pair<SmallVector<std::pair<unsigned, Operation *>>,
                 llvm::SetVector<Operation *>>
split(ArrayRef<std::pair<unsigned, Operation *>> group, Block &block) {
  SmallVector<std::pair<unsigned, Operation *>> own;
  llvm::SetVector<Operation *> branches;
  for (auto [number, op] : group) {
    Operation *ancestor = block.findAncestorOpInBlock(*op);
    if (ancestor == op)
      own.emplace_back(number, op);
    else if (ancestor)
      branches.insert(ancestor);
  }
  return {std::move(own), std::move(branches)};
}

/// Adds the sums of a group that are in a block or in branches in it.
void GatherBuilder::addBlock(Block &block, const Guard &guard, Group group,
                             IRMapping map, MutableArrayRef<Partial> partials) {
  auto [own, branches] = split(group, block);
  if (!own.empty())
    addGuarded(
        guard.build(*this, back, halo), partials,
        [&](MutableArrayRef<Partial> inner) { addValues(own, map, inner); });
  for (Operation *branch : branches)
    addBranch(cast<scf::IfOp>(branch), guard, group, map, partials);
}

/// Adds to the element of this thread, if others would have.
void GatherBuilder::store(const NeighborSums &all, const Partial &partial) {
  OpBuilder::InsertionGuard insertion(b);
  if (partial.any) {
    auto branch = scf::IfOp::create(b, loc, partial.any);
    b.setInsertionPointToStart(branch.thenBlock());
  }
  IRMapping map;
  map.map(adjoint.getArguments(),
          function.getArguments().take_front(adjoint.getNumArguments()));
  SmallVector<Value> indices;
  for (const NeighborIndex &index : all.indices)
    indices.push_back(index.fixed ? clone(index.fixed, map)
                                  : Value(tid.getResult(index.dimension)));
  warp::AccumulateOp::create(b, loc, partial.sum, clone(all.gradients, map),
                             indices, b.getI64IntegerAttr(rank));
}

void GatherBuilder::store(ArrayRef<Partial> partials) {
  for (auto [all, partial] : llvm::zip_equal(gathers, partials))
    store(all, partial);
}

//===----------------------------------------------------------------------===//
// Inside
//===----------------------------------------------------------------------===//

/// The values of the adjoint before all others, for the thread that adds to
/// this one's element at an offset.
IRMapping GatherBuilder::mapAt(const Offsets &offsets) {
  IRMapping map;
  map.map(adjoint.getArguments(),
          function.getArguments().take_front(adjoint.getNumArguments()));
  adjoint.walk([&](warp::TidOp op) {
    for (unsigned i = 0; i < rank; ++i)
      map.map(op.getResult(i), shifted(i, -offsets[i]));
  });
  return map;
}

/// Lists the sums of a group that are in a block or in branches in it. False if
/// whether they are made depends on more than where the thread is.
bool GatherBuilder::collect(Block &block, const Guard &guard, Group group,
                            IRMapping map, std::vector<Term> &terms) {
  auto [own, branches] = split(group, block);
  if (!own.empty())
    terms.push_back({guard, back, map, own});
  for (Operation *op : branches) {
    auto branch = cast<scf::IfOp>(op);
    if (!isSpeculatable(branch.getCondition()))
      return false;
    for (Block *side : {branch.thenBlock(), branch.elseBlock()}) {
      if (!side)
        continue;
      Guard inner = guard;
      inner.add(*this, branch.getCondition(), side == branch.thenBlock(),
                [&](Value value) { return clone(value, map); });
      if (!inner.isAboutIndices() || !collect(*side, inner, group, map, terms))
        return false;
    }
  }
  return true;
}

bool GatherBuilder::isShort() const {
  int64_t count = 0;
  for (auto &[offsets, group] : sums)
    for (auto [number, op] : group)
      count += getSlice(op).size();
  return count <= mostTwice;
}

/// True if this thread has all terms, as far as it is about the dimensions
/// before the last.
Value GatherBuilder::isInside(ArrayRef<Term> terms) {
  Value all;
  for (const Term &term : terms)
    all = both(all, term.guard.build(*this, term.back, halo, 0, rank - 1));
  return all;
}

void GatherBuilder::addInside(ArrayRef<Term> terms) {
  SmallVector<Partial> partials(gathers.size());
  std::vector<bool> isAdded(terms.size());
  unsigned last = rank - 1;
  for (auto [i, first] : llvm::enumerate(terms)) {
    if (isAdded[i])
      continue;
    Value guard = first.guard.build(*this, first.back, halo, last, rank);
    addGuarded(guard, partials, [&](MutableArrayRef<Partial> inner) {
      for (auto [j, term] : llvm::enumerate(terms)) {
        if (isAdded[j] || term.back[last] != first.back[last] ||
            !term.guard.agrees(first.guard, last))
          continue;
        isAdded[j] = true;
        addValues(term.sums, term.map, inner);
      }
    });
  }
  store(partials);
}

void GatherBuilder::addAnywhere() {
  SmallVector<Partial> partials(gathers.size());
  for (auto &[offsets, group] : sums) {
    back = offsets;
    addBlock(adjoint.getBody().front(), Guard(extents), group, mapAt(offsets),
             partials);
  }
  store(partials);
}

void GatherBuilder::build() {
  createFunction();
  halo.assign(rank, 0);
  for (auto &[offsets, group] : sums)
    for (unsigned i = 0; i < rank; ++i)
      halo[i] = std::max(halo[i], offsets[i]);
  setAttributes();
  std::vector<Term> terms;
  bool isPlain = rank > 1 && sums.size() > 1 && isShort();
  for (auto &[offsets, group] : sums) {
    back = offsets;
    isPlain = isPlain && collect(adjoint.getBody().front(), Guard(extents),
                                 group, mapAt(offsets), terms);
  }
  Value inside = isPlain ? isInside(terms) : nullptr;
  if (inside) {
    auto branch = scf::IfOp::create(b, loc, inside, /*withElseRegion=*/true);
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(branch.thenBlock());
    addInside(terms);
    b.setInsertionPointToStart(branch.elseBlock());
    addAnywhere();
  } else {
    addAnywhere();
  }
  for (Operation *copy : clones)
    copy->walk([&](Operation *op) { simplify(op); });
}

void warp::autodiff::buildGather(func::FuncOp adjoint,
                                 ArrayRef<NeighborSums> gathers,
                                 const SumsByOffset &sums, unsigned rank) {
  GatherBuilder(adjoint, gathers, sums, rank).build();
}
