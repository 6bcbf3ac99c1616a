//===- LaneAccess.h - Where lanes find their elements -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LANEACCESS_H
#define WARP_LIB_TRANSFORMS_LANEACCESS_H

#include "ArrayLowering.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/IR/Matchers.h"

namespace warp {

/// Where the lanes of an access find their elements.
struct ArrayLowering::LaneAccess {
  llvm::SmallVector<Leaf> leaves;
  mlir::Value mask;
  bool isFull = false;
  int64_t lanes = 0;
  /// `unit`: address of the first lane's element. Otherwise a vector of
  /// addresses.
  mlir::Value pointer;

  /// Whether an element is two to four numbers of 32 or 64 bits that follow
  /// each other, so that a lane can take it as a whole.
  bool hasWords() const {
    size_t count = leaves.size();
    int64_t size = getByteSize(leaves[0].type);
    if (count < 2 || count > 4 || (size != 4 && size != 8) || lanes % 4 != 0)
      return false;
    for (auto [i, leaf] : llvm::enumerate(leaves))
      if (leaf.type != leaves[0].type || leaf.offset != int64_t(i) * size)
        return false;
    return true;
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

/// Whether a mask certainly has all lanes.
inline bool isFullMask(mlir::Value mask) {
  mlir::DenseElementsAttr known;
  return matchPattern(mask, mlir::m_Constant(&known)) && known.isSplat() &&
         known.getSplatValue<bool>();
}

/// The type of a component in memory, in lanes.
inline mlir::VectorType storedLanes(mlir::Type type, int64_t lanes) {
  mlir::Type stored =
      isBool(type) ? mlir::IntegerType::get(type.getContext(), 8)
                   : getSignless(type);
  return mlir::VectorType::get(lanes, stored);
}

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LANEACCESS_H
