//===- Qr.cpp - QR decomposition ------------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Q is the right-handed orthonormal basis of the columns, so the first two
// entries of the diagonal of R are not negative, and the third has the sign of
// the determinant.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

Scalars lowerQr3(Emitter &, Operands args) {
  Scaled scaled = scaleToUnit(args[0].scalars);
  Columns a = getColumns(scaled.scalars), q = getBasis(a[0], a[1]);
  Scalar zero = args[0][0].like(0);
  auto product = [&](int i, int j) {
    return dot(q[i], a[j]) * scaled.unscale;
  };
  // If the first two columns are parallel, the second entry of the diagonal
  // is the rounding error of zero.
  Scalar middle = product(1, 1);
  Scalars results = getRowMajor(q);
  llvm::append_range(results, Scalars{product(0, 0), product(0, 1),
                                      product(0, 2), zero,
                                      select(middle < 0, zero, middle),
                                      product(1, 2), zero, zero,
                                      product(2, 2)});
  return results;
}

} // namespace warp::lowering
