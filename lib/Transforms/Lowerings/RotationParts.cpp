//===- RotationParts.cpp - Euler angles, axes and angles ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Angles and twists of quaternions; matrices of transforms and back.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

//===----------------------------------------------------------------------===//
// Quaternions
//===----------------------------------------------------------------------===//

/// Next to a right angle asin would lose half of the digits of the pitch, and
/// 1 - sin^2 all of those of its cosine, which is a product of lengths.
Scalars lowerQuatToRpy(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[0].scalars;
  Scalar x = q[0], y = q[1], z = q[2], w = q[3];
  Scalar roll = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
  Scalar yaw = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
  // Their squares are 1 + sin(pitch) and 1 - sin(pitch).
  Scalar above = length({w + y, x - z}), below = length({w - y, x + z});
  Scalar sine = 2.0 * differenceOfProducts(w, y, x, z);
  Scalar pitch = atan2(sine, above * below);
  return {roll, pitch, yaw};
}

Scalars lowerQuatTwist(Emitter &, Operands args) {
  ArrayRef<Scalar> axis = args[0].scalars, q = args[1].scalars;
  Scalar along = dot(axis, q.take_front(3));
  Scalars twist = forEach(axis, [&](Scalar x) { return x * along; });
  twist.push_back(q[3]);
  Scalars identity(4, along.like(0));
  identity[3] = along.like(1);
  return normalize(twist, identity);
}

Scalars lowerQuatTwistAngle(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[1].scalars;
  return {2.0 * atan2(abs(dot(args[0].scalars, q.take_front(3))), q[3])};
}

Scalars lowerQuatTwistAngleSigned(Emitter &, Operands args) {
  ArrayRef<Scalar> q = args[1].scalars;
  return {2.0 * atan2(dot(args[0].scalars, q.take_front(3)), q[3])};
}

//===----------------------------------------------------------------------===//
// Matrices of transforms
//===----------------------------------------------------------------------===//

/// Rows of the affine matrix with this upper left block and last column.
static Scalars getAffine(ArrayRef<Scalar> block, ArrayRef<Scalar> column) {
  Scalars matrix;
  for (int row = 0; row < 3; ++row) {
    llvm::append_range(matrix, block.slice(3 * row, 3));
    matrix.push_back(column[row]);
  }
  matrix.append(3, column[0].like(0));
  matrix.push_back(column[0].like(1));
  return matrix;
}

static Scalars getColumn(const Parts &m, int column) {
  return {m(0, column), m(1, column), m(2, column)};
}

static Scalars getRotationMatrix(Emitter &emitter, ArrayRef<Scalar> q) {
  auto type = QuatType::get(q[0].type.getContext(), q[0].type);
  return lowerQuatToMatrix(emitter, Parts{type, q});
}

Scalars lowerTransformToMatrix(Emitter &emitter, Operands args) {
  ArrayRef<Scalar> t = args[0].scalars;
  return getAffine(getRotationMatrix(emitter, t.drop_front(3)),
                   t.take_front(3));
}

Scalars lowerTransformFromMatrix(Emitter &emitter, Operands args) {
  Scalars transform = getColumn(args[0], 3);
  llvm::append_range(transform, lowerQuatFromMatrix(emitter, args[0]));
  return transform;
}

Scalars lowerTransformCompose(Emitter &emitter, Operands args) {
  Scalars block = getRotationMatrix(emitter, args[1].scalars);
  for (size_t i = 0; i < block.size(); ++i)
    block[i] = block[i] * args[2][i % 3];
  return getAffine(block, args[0].scalars);
}

/// The scale of an axis is the length of its column; a column of zeros is
/// left as it is.
Scalars lowerTransformDecompose(Emitter &emitter, Operands args) {
  const Parts &m = args[0];
  Type scalar = m[0].type;
  Scalars scale, rotation(9, m[0]);
  for (int col = 0; col < 3; ++col) {
    Scalars column = getColumn(m, col);
    scale.push_back(length(column));
    Scalars unit = normalize(column, Scalars(3, m[0].like(0)));
    for (int row = 0; row < 3; ++row)
      rotation[3 * row + col] = unit[row];
  }
  auto type = MatType::get(scalar.getContext(), 3, 3, scalar);
  Scalars parts = getColumn(m, 3);
  llvm::append_range(parts,
                     lowerQuatFromMatrix(emitter, Parts{type, rotation}));
  llvm::append_range(parts, scale);
  return parts;
}

} // namespace warp::lowering
