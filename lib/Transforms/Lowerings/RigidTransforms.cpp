//===- RigidTransforms.cpp - Lowerings for rigid transforms ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

static ArrayRef<Scalar> getTranslation(ArrayRef<Scalar> t) {
  return t.take_front(3);
}

static ArrayRef<Scalar> getRotation(ArrayRef<Scalar> t) {
  return t.drop_front(3);
}

static Scalars join(ArrayRef<Scalar> p, ArrayRef<Scalar> q) {
  Scalars t(p);
  llvm::append_range(t, q);
  return t;
}

static Scalars transformPoint(ArrayRef<Scalar> t, ArrayRef<Scalar> p) {
  return zipWith(getTranslation(t), rotate(getRotation(t), p), std::plus<>());
}

Scalars multiplyTransforms(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  return join(transformPoint(a, getTranslation(b)),
              multiplyQuats(getRotation(a), getRotation(b)));
}

Scalars lowerTransformGetTranslation(Emitter &, Operands args) {
  return Scalars(getTranslation(args[0].scalars));
}

Scalars lowerTransformGetRotation(Emitter &, Operands args) {
  return Scalars(getRotation(args[0].scalars));
}

Scalars lowerTransformSetTranslation(Emitter &, Operands args) {
  return join(args[1].scalars, getRotation(args[0].scalars));
}

Scalars lowerTransformSetRotation(Emitter &, Operands args) {
  return join(getTranslation(args[0].scalars), args[1].scalars);
}

Scalars lowerTransformMultiply(Emitter &, Operands args) {
  return multiplyTransforms(args[0].scalars, args[1].scalars);
}

Scalars lowerTransformInverse(Emitter &, Operands args) {
  ArrayRef<Scalar> q = getRotation(args[0].scalars);
  Scalars p = rotateInverse(q, getTranslation(args[0].scalars));
  return join(forEach(p, std::negate<>()), {-q[0], -q[1], -q[2], q[3]});
}

/// The upper left block of an affine matrix times a vector.
static Scalars multiplyBlock(const Parts &m, ArrayRef<Scalar> v) {
  Scalars result;
  for (int i = 0; i < 3; ++i)
    result.push_back(m(i, 0) * v[0] + m(i, 1) * v[1] + m(i, 2) * v[2]);
  return result;
}

Scalars lowerTransformPoint(Emitter &, Operands args) {
  const Parts &t = args[0];
  if (isa<TransformType>(t.type))
    return transformPoint(t.scalars, args[1].scalars);
  Scalars offset = {t(0, 3), t(1, 3), t(2, 3)};
  return zipWith(multiplyBlock(t, args[1].scalars), offset, std::plus<>());
}

Scalars lowerTransformVector(Emitter &, Operands args) {
  if (isa<TransformType>(args[0].type))
    return rotate(getRotation(args[0].scalars), args[1].scalars);
  return multiplyBlock(args[0], args[1].scalars);
}

} // namespace warp::lowering
