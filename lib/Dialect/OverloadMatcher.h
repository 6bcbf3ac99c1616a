//===- OverloadMatcher.h - Unifies overloads with types ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_DIALECT_OVERLOADMATCHER_H
#define WARP_LIB_DIALECT_OVERLOADMATCHER_H

#include "WarpDialect/Registry.h"
#include "WarpDialect/Signature.h"
#include "WarpDialect/WarpTypes.h"

#include <array>

namespace warp {

/// The parsed overloads of a record, in its order.
llvm::ArrayRef<Signature> getSignatures(const BuiltinSpec &spec);

/// Binds the letters of one overload.
class OverloadMatcher {
public:
  explicit OverloadMatcher(mlir::MLIRContext *context) : context(context) {}

  /// True if operands of these types fit; afterwards the letters are bound.
  bool match(const Signature &signature, mlir::TypeRange operands);
  /// The type that a pattern stands for.
  mlir::Type build(const TypePattern &pattern) const;

private:
  bool match(const TypePattern &pattern, mlir::Type type);
  bool bind(char letter, mlir::Type type);
  bool bind(const TypePattern::Extent &extent, int64_t number);

  mlir::MLIRContext *context;
  std::array<mlir::Type, 26> types;
  std::array<int64_t, 26> extents;
};

/// The message for operands that fit no overload.
std::string describeMismatch(const BuiltinSpec &spec,
                             mlir::MLIRContext *context,
                             mlir::TypeRange operands);

} // namespace warp

#endif // WARP_LIB_DIALECT_OVERLOADMATCHER_H
