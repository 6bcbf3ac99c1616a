//===- LowerElements.cpp - Loads and stores of elements of arrays ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// All loads of one composite are emitted next to each other, and so are its
// stores; on the GPU this decides how much of the memory's bandwidth is used.
// LLVM makes one access of up to 16 bytes of aligned elements.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

#include <numeric>

using namespace mlir;
using namespace warp;

mlir::Value ArrayLowering::zeroOf(mlir::Type type) {
  if (isa<LLVM::LLVMStructType>(type))
    return LLVM::ZeroOp::create(b, loc, type);
  return arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
}

/// Tells LLVM what does not overlap, which vector loops over tiles would
/// otherwise ask.
template <typename Op>
void ArrayLowering::setOwner(Op access, ArrayParts::Owner owner) {
  if (gpu || owner == ArrayParts::Owner::Unknown ||
      !entry->hasAttr(attr::blockBytes))
    return;
  if (!blockScope) {
    auto domain = LLVM::AliasScopeDomainAttr::get(
        b.getContext(), b.getStringAttr("memory of a launch"));
    blockScope = b.getArrayAttr(
        LLVM::AliasScopeAttr::get(domain, b.getStringAttr("shared memory")));
  }
  if (owner == ArrayParts::Owner::Block)
    access.setAliasScopesAttr(blockScope);
  else
    access.setNoaliasScopesAttr(blockScope);
}

/// Reads a scalar, or an array's descriptor, signless.
mlir::Value ArrayLowering::loadLeaf(mlir::Type type, mlir::Value from,
                                    ArrayParts::Owner owner,
                                    int64_t alignment) {
  mlir::Type stored = isBool(type) ? i8 : getSignless(type);
  auto load = LLVM::LoadOp::create(b, loc, stored, from,
                                   std::max(getByteSize(type), alignment));
  setOwner(load, owner);
  if (!isBool(type))
    return load;
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, load,
                               constant(i8, 0));
}

void ArrayLowering::storeLeaf(mlir::Value value, mlir::Type type,
                              mlir::Value to, ArrayParts::Owner owner,
                              int64_t alignment) {
  if (isBool(type))
    value = arith::ExtUIOp::create(b, loc, i8, value);
  auto store = LLVM::StoreOp::create(b, loc, value, to,
                                     std::max(getByteSize(type), alignment));
  setOwner(store, owner);
}

/// The divisor of a position in an element.
static int64_t alignmentAt(const ArrayParts &parts, const Leaf &leaf) {
  return std::gcd(parts.alignment, leaf.offset);
}

void ArrayLowering::lowerLoad(LoadComponentsOp op) {
  if (auto found = staged.loads.find(op); found != staged.loads.end())
    return lowerStaged(found->second);
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  Address at = address(op.getArray(), op.getIndices());
  const ArrayParts parts = getParts(op.getArray());
  SmallVector<mlir::Type> types;
  for (Leaf leaf : leaves) {
    auto array = dyn_cast<warp::ArrayType>(leaf.type);
    types.push_back(array ? getDescriptorType(array.getRank())
                          : getSignless(leaf.type));
  }
  auto values = guarded(op, op.getArray(), at, types, [&] {
    SmallVector<mlir::Value> pointers, loaded;
    for (Leaf leaf : leaves)
      pointers.push_back(advance(at.pointer, leaf.offset));
    for (auto [leaf, from] : llvm::zip(leaves, pointers)) {
      auto array = dyn_cast<warp::ArrayType>(leaf.type);
      if (!array) {
        loaded.push_back(
            loadLeaf(leaf.type, from, parts.owner, alignmentAt(parts, leaf)));
        if (parts.isGeometry && loaded.back().getType() == i32)
          loaded.back().getDefiningOp()->setAttr(attr::nonNegative,
                                                 b.getUnitAttr());
        continue;
      }
      mlir::Value key = op.getResult(loaded.size());
      known[key] = readDescriptor(from, 0, array.getRank(), 0);
      loaded.push_back(at.inside ? pack(key) : key);
    }
    return loaded;
  });
  for (auto [component, value] : llvm::zip(op.getComponents(), values)) {
    if (component == value)
      continue;
    if (isa<warp::ArrayType>(component.getType()))
      known[component] = ArrayParts(getParts(value));
    else
      component.replaceAllUsesWith(value);
  }
}

void ArrayLowering::lowerStore(StoreComponentsOp op) {
  if (staged.stores.contains(op))
    return lowerStaged(op);
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  Address at = address(op.getArray(), op.getIndices());
  const ArrayParts target = getParts(op.getArray());
  guarded(op, op.getArray(), at, {}, [&] {
    SmallVector<mlir::Value> pointers;
    for (Leaf leaf : leaves)
      pointers.push_back(advance(at.pointer, leaf.offset));
    for (auto [leaf, value, to] :
         llvm::zip(leaves, op.getComponents(), pointers)) {
      if (!isa<warp::ArrayType>(leaf.type)) {
        storeLeaf(value, leaf.type, to, target.owner,
                  alignmentAt(target, leaf));
        continue;
      }
      ArrayParts parts = getParts(value);
      LLVM::StoreOp::create(b, loc, parts.data, to, 8);
      for (int64_t d = 0, rank = parts.shape.size(); d < rank; ++d) {
        LLVM::StoreOp::create(b, loc, parts.shape[d],
                              advance(to, shapeOffset(d)), 4);
        mlir::Value bytes = widen(stride(parts, d), i32);
        LLVM::StoreOp::create(b, loc, bytes, advance(to, stridesOffset(d)), 4);
      }
      // The array has no gradient there. The rank comes with no flags, and
      // where there is no array it is zero, as in what Python makes.
      LLVM::StoreOp::create(b, loc, constant(i64, 0), advance(to, gradOffset),
                            8);
      mlir::Value none = LLVM::ZeroOp::create(b, loc, parts.data.getType());
      mlir::Value isNone = LLVM::ICmpOp::create(b, loc, LLVM::ICmpPredicate::eq,
                                                parts.data, none);
      mlir::Value rank = LLVM::SelectOp::create(
          b, loc, isNone, constant(i64, 0), constant(i64, parts.shape.size()));
      LLVM::StoreOp::create(b, loc, rank,
                            advance(to, offsetof(ArrayDescriptor, ndim)), 8);
    }
    return SmallVector<mlir::Value>();
  });
}

void ArrayLowering::lowerAddress(AddressOp op) {
  Address at = address(op.getArray(), op.getIndices());
  auto number = guarded(op, op.getArray(), at, i64, [&] {
    return SmallVector<mlir::Value>{
        LLVM::PtrToIntOp::create(b, loc, i64, at.pointer)};
  });
  op->replaceAllUsesWith(number);
}
