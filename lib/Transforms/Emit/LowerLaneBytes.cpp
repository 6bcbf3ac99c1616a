//===- LowerLaneBytes.cpp - Gathers of elements below 32 bits -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An element of three or four numbers in as few bytes, such as a colour, lies
// in two words of 32 bits at most. Lanes gather these, and shift the element
// out of them, rather than to take it number by number: bytes cannot be
// gathered, and one at a time they are three instructions each. No aligned word
// reaches over the end of a page, so what lies beside the element can be read.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp;

static constexpr int64_t wordSize = 4, byteBits = 8;

/// The end of an element, from its start on.
static int64_t endOf(ArrayRef<Leaf> leaves) {
  int64_t end = 0;
  for (const Leaf &leaf : leaves)
    end = std::max(end, leaf.offset + getByteSize(leaf.type));
  return end;
}

bool ArrayLowering::LaneAccess::isFewBytes() const {
  return leaves.size() > 2 && endOf(leaves) <= wordSize;
}

SmallVector<mlir::Value> ArrayLowering::loadBytes(const LaneAccess &access) {
  auto words = VectorType::get(access.lanes, i32);
  auto wide = VectorType::get(access.lanes, i64);
  auto splat = [&](VectorType type, int64_t number) -> mlir::Value {
    auto value = b.getIntegerAttr(type.getElementType(), number);
    return arith::ConstantOp::create(b, loc,
                                     DenseElementsAttr::get(type, value));
  };
  mlir::Value first = LLVM::PtrToIntOp::create(b, loc, wide, access.pointer);
  auto wordAt = [&](mlir::Value address) -> mlir::Value {
    mlir::Value start =
        arith::AndIOp::create(b, loc, address, splat(wide, -wordSize));
    mlir::Value from =
        LLVM::IntToPtrOp::create(b, loc, access.pointer.getType(), start);
    return LLVM::masked_gather::create(b, loc, words, from, access.mask,
                                       ValueRange(splat(words, 0)),
                                       b.getI32IntegerAttr(wordSize));
  };
  mlir::Value last = arith::AddIOp::create(
      b, loc, first, splat(wide, endOf(access.leaves) - 1));
  mlir::Value low = arith::TruncIOp::create(b, loc, words, first);
  mlir::Value inWord =
      arith::AndIOp::create(b, loc, low, splat(words, wordSize - 1));
  mlir::Value shift =
      arith::MulIOp::create(b, loc, inWord, splat(words, byteBits));
  mlir::Value element =
      LLVM::FshrOp::create(b, loc, wordAt(last), wordAt(first), shift);
  SmallVector<mlir::Value> components;
  for (const Leaf &leaf : access.leaves) {
    mlir::Value bits = arith::ShRUIOp::create(
        b, loc, element, splat(words, leaf.offset * byteBits));
    auto number = b.getIntegerType(byteBits * getByteSize(leaf.type));
    components.push_back(arith::TruncIOp::create(
        b, loc, VectorType::get(access.lanes, number), bits));
  }
  return components;
}
