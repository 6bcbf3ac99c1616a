//===- IntegerFold.h - Constant folding of integers -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_COMPOSITES_INTEGERFOLD_H
#define WARP_TRANSFORMS_COMPOSITES_INTEGERFOLD_H

#include "llvm/ADT/APInt.h"
#include "llvm/ADT/StringSwitch.h"

#include <optional>

namespace warp {

/// Folds operations on two integers of the same type, as they are found in
/// indices.
struct IntegerFold {
  llvm::APInt a, c;
  bool isUnsigned;

  bool less() const { return isUnsigned ? a.ult(c) : a.slt(c); }
  bool divides() const { return !c.isZero() && (isUnsigned || !c.isAllOnes()); }
  static llvm::APInt bit(bool holds) { return llvm::APInt(1, holds); }

  std::optional<llvm::APInt> compare(llvm::StringRef name) const {
    return llvm::StringSwitch<std::optional<llvm::APInt>>(name)
        .Case("lt", bit(less()))
        .Case("le", bit(less() || a == c))
        .Case("gt", bit(!less() && a != c))
        .Case("ge", bit(!less()))
        .Case("eq", bit(a == c))
        .Case("ne", bit(a != c))
        .Default(std::nullopt);
  }

  std::optional<llvm::APInt> divide(llvm::StringRef name) const {
    if (!divides())
      return std::nullopt;
    llvm::APInt quotient = isUnsigned ? a.udiv(c) : a.sdiv(c);
    llvm::APInt rest = isUnsigned ? a.urem(c) : a.srem(c);
    bool isBelow =
        !isUnsigned && !rest.isZero() && a.isNegative() != c.isNegative();
    return llvm::StringSwitch<std::optional<llvm::APInt>>(name)
        .Case("div", quotient)
        .Case("mod", rest)
        .Case("floordiv", isBelow ? quotient - 1 : quotient)
        .Default(std::nullopt);
  }

  std::optional<llvm::APInt> shift(llvm::StringRef name) const {
    if (c.uge(a.getBitWidth()))
      return std::nullopt;
    return llvm::StringSwitch<std::optional<llvm::APInt>>(name)
        .Case("lshift", a.shl(c))
        .Case("rshift", isUnsigned ? a.lshr(c) : a.ashr(c))
        .Default(std::nullopt);
  }

  std::optional<llvm::APInt> combine(llvm::StringRef name) const {
    return llvm::StringSwitch<std::optional<llvm::APInt>>(name)
        .Case("add", a + c)
        .Case("sub", a - c)
        .Case("mul", a * c)
        .Case("min", less() ? a : c)
        .Case("max", less() ? c : a)
        .Case("bit_and", a & c)
        .Case("bit_or", a | c)
        .Case("bit_xor", a ^ c)
        .Default(std::nullopt);
  }
};

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_INTEGERFOLD_H
