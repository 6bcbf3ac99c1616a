//===- ElementStage.cpp - Warp-cooperative element accesses ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// See StageElements.cpp. In the slab, elements of an even number of words would
// begin at few of the banks. Where they begin at the first one again a word of
// padding moves the next ones on; so neither shares nor elements conflict, and
// all words but the first are at constant offsets.
//
// Elements of rows are moved by groups of as many threads as an element has
// words, rounded up to a power of two: one thread for each word, those beyond
// the last word do the same as the one that has it. So an instruction touches
// the lines of 32 / 8 elements of seven words, in place of 32.
//
//===----------------------------------------------------------------------===//

#include "Emit/ArrayLowering.h"
#include "GpuBlock.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "llvm/Support/MathExtras.h"

#include <numeric>

using namespace mlir;

int64_t warp::getSlabPeriod(int64_t count, int64_t warpSize) {
  return std::lcm(count, warpSize);
}

Value warp::isWholeWarp(OpBuilder &b, Location loc,
                        const StagedAccesses &staged) {
  Value whole = isFullWarp(b, loc);
  if (staged.inRow)
    whole = arith::AndIOp::create(b, loc, whole, staged.inRow);
  return whole;
}

Value warp::beginOfRow(OpBuilder &b, Location loc, const StagedAccesses &staged,
                       Value pointer, int64_t size) {
  Type i64 = b.getI64Type();
  Value place = LLVM::PtrToIntOp::create(b, loc, i64, pointer);
  Value lane = arith::ExtUIOp::create(b, loc, i64, staged.lane);
  Value bytes = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(size));
  return arith::SubIOp::create(b, loc, place,
                               arith::MulIOp::create(b, loc, lane, bytes));
}

Value warp::areStretches(OpBuilder &b, Location loc,
                         const StagedAccesses &staged, ValueRange pointers,
                         ArrayRef<int64_t> sizes) {
  auto branch = scf::IfOp::create(b, loc, b.getI1Type(), isFullWarp(b, loc),
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  Value no = arith::ConstantOp::create(b, loc, b.getBoolAttr(false));
  scf::YieldOp::create(b, loc, no);
  b.setInsertionPointToStart(branch.thenBlock());
  Value zero = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  Value follow = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  for (auto [pointer, size] : llvm::zip_equal(pointers, sizes)) {
    Value start = beginOfRow(b, loc, staged, pointer, size);
    Value first = shuffle(b, loc, ShuffleMode::index, start, zero);
    Value same =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, start, first);
    follow = arith::AndIOp::create(b, loc, follow, same);
  }
  scf::YieldOp::create(b, loc, holdsInWarp(b, loc, follow));
  return branch.getResult(0);
}

warp::ElementStage::ElementStage(OpBuilder &b, Location loc,
                                 const StagedAccesses &staged, Type type,
                                 Value pointer, Value rowBytes)
    : b(b), loc(loc), word(getSignless(getElementScalar(type))),
      bytes(getByteSize(word)), count(getComponentCount(type)),
      warpSize(subgroupSizeAt(b)), period(getSlabPeriod(count, warpSize)),
      step(rowBytes), shareWords(count) {
  if (rowBytes)
    placeRows(staged.lane, pointer, staged.slab);
  else
    placeStretch(staged.lane, pointer, staged.slab);
}

void warp::ElementStage::placeStretch(Value lane, Value pointer, Value slab) {
  auto mul = [&](int64_t factor) -> Value {
    return arith::MulIOp::create(b, loc, lane, constant(factor));
  };
  memory = advance(pointer, mul(1 - count));
  share = advance(slab, lane);
  Value begin = mul(count);
  if (int64_t elements = period / count; elements < warpSize) {
    Value pads =
        arith::ShRUIOp::create(b, loc, lane, constant(llvm::Log2_64(elements)));
    begin = arith::AddIOp::create(b, loc, begin, pads);
  }
  element = advance(slab, begin);
}

void warp::ElementStage::placeRows(Value lane, Value pointer, Value slab) {
  Type i64 = b.getI64Type();
  int64_t pitch = getRowPitch(count);
  shareWords = llvm::PowerOf2Ceil(count);
  int64_t rows = warpSize / shareWords;
  shareStep = rows * pitch;
  Value row =
      arith::ShRUIOp::create(b, loc, lane, constant(llvm::Log2_64(shareWords)));
  Value own = arith::AndIOp::create(b, loc, lane, constant(shareWords - 1));
  own = arith::MinUIOp::create(b, loc, own, constant(count - 1));
  Value away = arith::ExtSIOp::create(b, loc, i64,
                                      arith::SubIOp::create(b, loc, row, lane));
  away = arith::MulIOp::create(b, loc, away, step);
  memory = LLVM::GEPOp::create(b, loc, pointer.getType(), b.getI8Type(),
                               pointer, ArrayRef<LLVM::GEPArg>(away));
  memory = advance(memory, own);
  Value first = arith::MulIOp::create(b, loc, row, constant(pitch));
  share = advance(slab, arith::AddIOp::create(b, loc, first, own));
  element = advance(slab, arith::MulIOp::create(b, loc, lane, constant(pitch)));
  Value number = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(rows));
  step = arith::MulIOp::create(b, loc, step, number);
}

Value warp::ElementStage::constant(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

Value warp::ElementStage::advance(Value base, Value words) {
  return LLVM::GEPOp::create(b, loc, base.getType(), word, base,
                             ArrayRef<LLVM::GEPArg>(words),
                             LLVM::GEPNoWrapFlags::inbounds);
}

Value warp::ElementStage::advance(Value base, int64_t words) {
  return LLVM::GEPOp::create(b, loc, base.getType(), word, base,
                             ArrayRef<LLVM::GEPArg>(int32_t(words)),
                             LLVM::GEPNoWrapFlags::inbounds);
}

/// The place in memory of word `i` of the share.
Value warp::ElementStage::inMemory(int64_t i) {
  if (!step)
    return advance(memory, warpSize * i);
  Value number = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(i));
  Value away = arith::MulIOp::create(b, loc, step, number);
  return LLVM::GEPOp::create(b, loc, memory.getType(), b.getI8Type(), memory,
                             ArrayRef<LLVM::GEPArg>(away));
}

/// The place in the slab of word `i` of the share.
Value warp::ElementStage::inShare(int64_t i) {
  if (step)
    return advance(share, shareStep * i);
  return advance(share, warpSize * i + warpSize * i / period);
}

SmallVector<Value> warp::ElementStage::load(int64_t number, Slot from) {
  SmallVector<Value> words;
  for (int64_t i = 0; i < number; ++i)
    words.push_back(LLVM::LoadOp::create(b, loc, word, from(i), bytes));
  return words;
}

void warp::ElementStage::store(ValueRange words, Slot to) {
  for (auto [i, value] : llvm::enumerate(words))
    LLVM::StoreOp::create(b, loc, value, to(i), bytes);
}

SmallVector<Value> warp::ElementStage::loadShare() {
  return load(shareWords, [&](int64_t i) { return inMemory(i); });
}

void warp::ElementStage::storeShare(ValueRange words) {
  store(words, [&](int64_t i) { return inMemory(i); });
}

SmallVector<Value> warp::ElementStage::shareToElement(ValueRange words) {
  store(words, [&](int64_t i) { return inShare(i); });
  synchronizeWarp(b, loc);
  return load(count, [&](int64_t i) { return advance(element, i); });
}

SmallVector<Value> warp::ElementStage::elementToShare(ValueRange words) {
  store(words, [&](int64_t i) { return advance(element, i); });
  synchronizeWarp(b, loc);
  return load(shareWords, [&](int64_t i) { return inShare(i); });
}

//===----------------------------------------------------------------------===//
// Lowering
//===----------------------------------------------------------------------===//

Value warp::ArrayLowering::isWhole(Operation *access, ValueRange pointers,
                                   ArrayRef<Type> elements) {
  Value &known = wholeWarps[access->getBlock()];
  if (!known)
    known = isWholeWarp(b, loc, staged);
  if (!staged.inRow)
    return known;
  auto branch = scf::IfOp::create(b, loc, b.getI1Type(), known,
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, known);
  b.setInsertionPointToStart(branch.elseBlock());
  SmallVector<int64_t> sizes(llvm::map_range(elements, getByteSize));
  scf::YieldOp::create(b, loc, areStretches(b, loc, staged, pointers, sizes));
  return branch.getResult(0);
}

/// The same for elements of rows of a launch that is large enough; threads
/// compare the other indices.
Value warp::ArrayLowering::isWholeOfRows(Operation *access,
                                         ValueRange indices) {
  SmallVector<Value> compared;
  for (auto [dim, index] : llvm::enumerate(indices))
    if (dim != staged.rows.lookup(access) && !matchPattern(index, m_Constant()))
      compared.push_back(index);
  auto branch = scf::IfOp::create(b, loc, b.getI1Type(), staged.isCrowded,
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, staged.isCrowded);
  b.setInsertionPointToStart(branch.thenBlock());
  Value whole = isWarpTogether(b, loc, compared);
  if (staged.inRow)
    whole = arith::AndIOp::create(b, loc, whole, staged.inRow);
  scf::YieldOp::create(b, loc, whole);
  return branch.getResult(0);
}

/// Bytes from a thread's element to the next thread's; null if they lie side by
/// side.
Value warp::ArrayLowering::rowBytes(Operation *access, Value array) {
  auto found = staged.rows.find(access);
  if (found == staged.rows.end())
    return nullptr;
  return stride(getParts(array), found->second);
}

static SmallVector<warp::Leaf> getLeaves(Type element) {
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(element, 0, leaves);
  return leaves;
}

/// Runs `whole` where all threads of the warp are there, `part` where most are,
/// and `alone` elsewhere; all give values of these types. Without `part` warps
/// are whole, or alone.
ValueRange warp::ArrayLowering::stage(Value isWhole, TypeRange types,
                                      ValueRange pointers,
                                      ArrayRef<Type> elements, Staged whole,
                                      PartStaged part, Staged alone) {
  auto branch = scf::IfOp::create(b, loc, types, isWhole, /*addThenBlock=*/true,
                                  /*addElseBlock=*/true);
  OpBuilder::InsertionGuard guard(b);
  auto yield = [&](Block *block, Staged values) {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(block);
    SmallVector<Value> results = values();
    scf::YieldOp::create(b, loc, results);
  };
  yield(branch.thenBlock(), whole);
  if (!part) {
    yield(branch.elseBlock(), alone);
    return branch.getResults();
  }
  yield(branch.elseBlock(), [&]() -> SmallVector<Value> {
    LaneGroup group = findGroup(b, loc, staged);
    SmallVector<int64_t> sizes(llvm::map_range(elements, getByteSize));
    Value dense = isDense(b, loc, staged, group, pointers, sizes);
    auto inner = scf::IfOp::create(b, loc, types, dense, /*addThenBlock=*/true,
                                   /*addElseBlock=*/true);
    yield(inner.thenBlock(), [&] { return part(group); });
    yield(inner.elseBlock(), alone);
    return inner.getResults();
  });
  return branch.getResults();
}

/// Loads of a group, as one conditional whose results are all components.
void warp::ArrayLowering::lowerStaged(ArrayRef<LoadComponentsOp> group) {
  if (group.empty())
    return;
  SmallVector<Type> types, elements;
  SmallVector<Value> pointers, rows;
  for (LoadComponentsOp op : group) {
    llvm::append_range(types, op.getResultTypes());
    elements.push_back(elementType(op.getArray()));
    pointers.push_back(address(op.getArray(), op.getIndices()).pointer);
    rows.push_back(rowBytes(op, op.getArray()));
  }
  auto whole = [&] {
    synchronizeWarp(b, loc);
    SmallVector<ElementStage> stages;
    SmallVector<SmallVector<Value>> shares;
    for (auto [element, pointer, row] :
         llvm::zip_equal(elements, pointers, rows)) {
      stages.emplace_back(b, loc, staged, element, pointer, row);
      shares.push_back(stages.back().loadShare());
    }
    SmallVector<Value> loaded;
    for (auto [i, share] : llvm::enumerate(shares)) {
      if (i > 0)
        synchronizeWarp(b, loc);
      llvm::append_range(loaded, stages[i].shareToElement(share));
    }
    if (staged.slotBytes)
      synchronizeWarp(b, loc);
    return loaded;
  };
  auto alone = [&] {
    SmallVector<Value> loaded;
    for (auto [element, pointer] : llvm::zip_equal(elements, pointers))
      for (Leaf leaf : getLeaves(element))
        loaded.push_back(loadLeaf(leaf.type, advance(pointer, leaf.offset)));
    return loaded;
  };
  LoadComponentsOp first = group.front();
  bool areOfRows = rows.front() != nullptr;
  Value isAll = areOfRows ? isWholeOfRows(first, first.getIndices())
                          : isWhole(first, pointers, elements);
  ValueRange results =
      stage(isAll, types, pointers, elements, whole, PartStaged(), alone);
  for (LoadComponentsOp op : group) {
    op.replaceAllUsesWith(results.take_front(op.getNumResults()));
    results = results.drop_front(op.getNumResults());
  }
}

/// True if all components are one constant, so that any thread may store any
/// of them.
static bool isOneConstant(ValueRange components) {
  Attribute first;
  return matchPattern(components.front(), m_Constant(&first)) &&
         llvm::all_of(components, [&](Value component) {
           Attribute other;
           return matchPattern(component, m_Constant(&other)) && other == first;
         });
}

void warp::ArrayLowering::lowerStaged(StoreComponentsOp op) {
  Type type = elementType(op.getArray());
  Value pointer = address(op.getArray(), op.getIndices()).pointer;
  Value row = rowBytes(op, op.getArray());
  SmallVector<Value> words(op.getComponents());
  bool isConstant = isOneConstant(words);
  auto whole = [&] {
    synchronizeWarp(b, loc);
    ElementStage stage(b, loc, staged, type, pointer, row);
    if (isConstant)
      words.resize(stage.getShareWords(), words.front());
    stage.storeShare(isConstant ? words : stage.elementToShare(words));
    synchronizeWarp(b, loc);
    return SmallVector<Value>();
  };
  auto part = [&](const LaneGroup &lanes) {
    PartialStage stage(b, loc, staged, lanes, type, pointer);
    if (isConstant)
      stage.fill(words.front());
    else
      stage.store(words);
    return SmallVector<Value>();
  };
  auto alone = [&] {
    for (auto [leaf, value] :
         llvm::zip_equal(getLeaves(type), op.getComponents()))
      storeLeaf(value, leaf.type, advance(pointer, leaf.offset));
    return SmallVector<Value>();
  };
  Value isAll =
      row ? isWholeOfRows(op, op.getIndices()) : isWhole(op, pointer, type);
  stage(isAll, {}, pointer, type, whole, row ? PartStaged() : part, alone);
}
