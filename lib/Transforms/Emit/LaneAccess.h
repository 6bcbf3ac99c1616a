//===- LaneAccess.h - Addresses of lane accesses ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LANEACCESS_H
#define WARP_LIB_TRANSFORMS_LANEACCESS_H

#include "ArrayLowering.h"
#include "Lanes/LiveLanes.h"
#include "WarpDialect/ParameterLayout.h"

namespace warp {

/// The elements of the lanes of an access.
struct ArrayLowering::LaneAccess {
  llvm::SmallVector<Leaf> leaves;
  mlir::Value mask;
  bool isFull = false;
  int64_t lanes = 0;
  /// `unit`: address of the first lane's element. Otherwise a vector of
  /// addresses.
  mlir::Value pointer;
  /// Bytes that are added to all of these, i64; null for none.
  mlir::Value offset;

  /// True if an element is several numbers of 32 or 64 bits that follow each
  /// other, so that a lane can take it in pieces of up to four.
  bool hasWords() const {
    int64_t size = getByteSize(leaves[0].type);
    if (leaves.size() < 2 || (size != 4 && size != 8) || lanes % 4 != 0)
      return false;
    for (auto [i, leaf] : llvm::enumerate(leaves))
      if (getByteSize(leaf.type) != size || leaf.offset != int64_t(i) * size)
        return false;
    return true;
  }

  /// True if an element is three or four numbers in as few bytes
  /// (LowerLaneBytes.cpp).
  bool isFewBytes() const;

  /// Lanes of what an element is made of: numbers of one type, or the bits of
  /// several.
  mlir::VectorType wordLanes() const;

  /// True if an element is better taken in rows than in whole vectors: by
  /// half for 8 or 16 numbers, and with few instructions. Blends are quicker
  /// for up to 9 if they are odd (mat33: by a tenth), masks of whole vectors
  /// for up to 4.
  bool prefersRows(int64_t stride) const {
    size_t count = leaves.size();
    bool hasBlends = stride == 1 && (isFull ? count % 2 != 0 && count <= 9
                                            : count <= 4);
    return hasWords() && count >= 4 && !hasBlends;
  }

  /// `unit`: the address of each lane's element, so many bytes apart. Lanes
  /// that are not live have that of one that is.
  llvm::SmallVector<mlir::Value> lanePointers(mlir::OpBuilder &b,
                                              mlir::Location loc,
                                              int64_t step) const;

  /// Addresses to store elements at, which are `step` bytes apart or (0)
  /// anywhere. Lanes that are not live have memory that nobody reads.
  llvm::SmallVector<mlir::Value> storePointers(mlir::OpBuilder &b,
                                               mlir::Location loc,
                                               mlir::LLVM::LLVMFuncOp entry,
                                               int64_t step) const;

  /// The number of a live lane.
  mlir::Value firstLive(mlir::OpBuilder &b, mlir::Location loc) const {
    mlir::Type type = b.getIntegerType(lanes);
    mlir::Value bits = mlir::LLVM::BitcastOp::create(b, loc, type, mask);
    return mlir::LLVM::CountTrailingZerosOp::create(b, loc, type, bits,
                                                    /*is_zero_poison=*/true);
  }

  /// The address so many bytes on. Where lanes are dead it may be outside of
  /// the array.
  mlir::Value move(mlir::OpBuilder &b, mlir::Location loc, int64_t bytes) const {
    return mlir::LLVM::GEPOp::create(
        b, loc, pointer.getType(), b.getI8Type(), pointer,
        llvm::ArrayRef<mlir::LLVM::GEPArg>(int32_t(bytes)),
        isFull ? mlir::LLVM::GEPNoWrapFlags::inbounds : mlir::LLVM::GEPNoWrapFlags::none);
  }
};

/// The type of a component in memory, in lanes.
inline mlir::VectorType storedLanes(mlir::Type type, int64_t lanes) {
  mlir::Type stored =
      isBool(type) ? mlir::IntegerType::get(type.getContext(), 8)
                   : getSignless(type);
  return mlir::VectorType::get(lanes, stored);
}

inline mlir::VectorType ArrayLowering::LaneAccess::wordLanes() const {
  bool isOne = llvm::all_of(leaves, [&](const Leaf &leaf) {
    return getSignless(leaf.type) == getSignless(leaves[0].type);
  });
  if (isOne)
    return storedLanes(leaves[0].type, lanes);
  return mlir::VectorType::get(
      lanes, mlir::IntegerType::get(leaves[0].type.getContext(),
                                    8 * getByteSize(leaves[0].type)));
}

/// One vector per component out of those that hold elements one after the
/// other; null where nobody wants it (LaneRegisters.cpp).
llvm::SmallVector<mlir::Value>
takeApart(mlir::OpBuilder &b, mlir::Location loc,
          llvm::ArrayRef<mlir::Value> vectors,
          llvm::function_ref<bool(int64_t)> isWanted);
/// The inverse.
llvm::SmallVector<mlir::Value>
putTogether(mlir::OpBuilder &b, mlir::Location loc,
            llvm::ArrayRef<mlir::Value> components);

/// Components of elements of which `pointerOf(lane)` is the address, lane by
/// lane (LowerLaneRows.cpp).
llvm::SmallVector<mlir::Value>
loadRows(mlir::OpBuilder &b, mlir::Location loc, mlir::VectorType component,
         int64_t count, llvm::function_ref<mlir::Value(int64_t)> pointerOf);
/// The inverse, one lane after the other.
void storeRows(mlir::OpBuilder &b, mlir::Location loc,
               llvm::ArrayRef<mlir::Value> components,
               llvm::function_ref<mlir::Value(int64_t)> pointerOf);
/// Exchanges rows and columns of the 4 x 4 squares that four vectors form.
llvm::SmallVector<mlir::Value> transpose(mlir::OpBuilder &b, mlir::Location loc,
                                         llvm::ArrayRef<mlir::Value> rows);
/// Numbers of a row.
constexpr int64_t rowSize = 4;

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LANEACCESS_H
