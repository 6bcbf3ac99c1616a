//===- LinearAlgebra.cpp - Lowerings for vectors and matrices -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If the sum of a vector's squares left the range in which it is accurate, its
// length is taken of the vector scaled by a power of two. That case is a branch
// of its own: it costs two integer operations where it is not taken.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

static Scalar sum(ArrayRef<Scalar> terms) {
  Scalar total = terms[0];
  for (Scalar term : terms.drop_front())
    total = total + term;
  return total;
}

Scalar dot(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  return sum(zipWith(a, b, std::multiplies<>()));
}

Scalars cross(ArrayRef<Scalar> a, ArrayRef<Scalar> b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
          a[0] * b[1] - a[1] * b[0]};
}

Scalar differenceOfProducts(Scalar a, Scalar b, Scalar c, Scalar d) {
  Scalar product = c * d;
  Scalar error = fma(-c, d, product);
  return fma(a, b, -product) + error;
}

//===----------------------------------------------------------------------===//
// Length
//===----------------------------------------------------------------------===//

/// A vector, the sum of its squares and, if it was scaled to keep that sum in
/// range, the factor back to the length of the original.
struct Squares {
  ArrayRef<Scalar> vector;
  Scalar sum;
  std::optional<Scalar> unscale;
};

/// The result of `use` for a vector whose squares are in range.
static Scalars withSquares(ArrayRef<Scalar> v,
                           llvm::function_ref<Scalars(const Squares &)> use) {
  Scalar squares = dot(v, v);
  Emitter &emitter = *squares.emitter;
  FloatFormat format(squares.type);
  Type bitsType = getBitsType(squares.type);
  // Bits of 2^k; as integers they are ordered like the floats.
  auto bitsOf = [&](int k) {
    return emitter.integer(bitsType, static_cast<uint64_t>(k + format.bias)
                                         << format.mantissaBits);
  };
  auto powerOfTwo = [&](int k) { return squares.like(std::ldexp(1.0, k)); };
  // Below this, squares of small components may have lost bits that count.
  int low = -format.bias + format.mantissaBits + 8;
  int high = format.bias - 8;
  Scalar distance = reinterpret(squares, bitsType) - bitsOf(low);
  Scalar isExtreme = distance >= bitsOf(high) - bitsOf(low);
  return branch(isExtreme, use({v, squares, std::nullopt}), [&] {
    int up = format.bias - format.mantissaBits - 4, down = -format.bias / 2 - 8;
    // Vectorised code takes this path for every lane; ordinary numbers must not
    // become denormal there, which is slow.
    Scalar isSmall = squares < powerOfTwo(high / 2);
    Scalar factor = select(isSmall, powerOfTwo(up), powerOfTwo(down));
    Scalars scaled = forEach(v, [&](Scalar x) { return x * factor; });
    return use({scaled, dot(scaled, scaled),
                select(isSmall, powerOfTwo(-up), powerOfTwo(-down))});
  });
}

Scalar length(ArrayRef<Scalar> v) {
  if (v.size() == 1)
    return abs(v[0]);
  if (const auto &keep = v[0].emitter->keep)
    return keep("length", v)[0];
  return withSquares(v, [](const Squares &squares) -> Scalars {
    Scalar root = sqrt(squares.sum);
    return {squares.unscale ? root * *squares.unscale : root};
  })[0];
}

Scalars normalize(ArrayRef<Scalar> v, ArrayRef<Scalar> otherwise) {
  if (const auto &keep = v[0].emitter->keep) {
    Scalar isZero = length(v) == 0;
    return zipWith(keep("normalize", v), otherwise, [&](Scalar x, Scalar y) {
      return select(isZero, y, x);
    });
  }
  return withSquares(v, [&](const Squares &squares) {
    Scalar inverse = 1.0 / sqrt(squares.sum);
    Scalars unit =
        forEach(squares.vector, [&](Scalar x) { return x * inverse; });
    if (!squares.unscale)
      return unit;
    Scalar isZero = squares.sum == 0;
    return zipWith(unit, otherwise, [&](Scalar x, Scalar instead) {
      return select(isZero, instead, x);
    });
  });
}

Scalars lowerLength(Emitter &, Operands args) {
  return {length(args[0].scalars)};
}

Scalars lowerLengthSq(Emitter &, Operands args) {
  return {dot(args[0].scalars, args[0].scalars)};
}

Scalars lowerNormalize(Emitter &, Operands args) {
  Scalars otherwise(args[0].size(), args[0][0].like(0));
  if (isa<QuatType>(args[0].type))
    otherwise.back() = args[0][0].like(1);
  return normalize(args[0].scalars, otherwise);
}

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

Scalars lowerDot(Emitter &, Operands args) {
  return {dot(args[0].scalars, args[1].scalars)};
}

Scalars lowerDdot(Emitter &, Operands args) {
  return {dot(args[0].scalars, args[1].scalars)};
}

Scalars lowerCross(Emitter &, Operands args) {
  return cross(args[0].scalars, args[1].scalars);
}

Scalars lowerOuter(Emitter &, Operands args) {
  Scalars result;
  for (Scalar a : args[0].scalars)
    for (Scalar b : args[1].scalars)
      result.push_back(a * b);
  return result;
}

Scalars lowerSkew(Emitter &, Operands args) {
  Scalar x = args[0][0], y = args[0][1], z = args[0][2], zero = x.like(0);
  return {zero, -z, y, z, zero, -x, -y, x, zero};
}

Scalars lowerCwDiv(Emitter &, Operands args) {
  return zipWith(args[0].scalars, args[1].scalars, std::divides<>());
}

//===----------------------------------------------------------------------===//
// Place of the extremum
//===----------------------------------------------------------------------===//

/// NaN never compares as better and is left as soon as a number comes.
static Scalars place(Emitter &emitter, Operands args,
                     Scalar (*isBetter)(Scalar, Scalar)) {
  Scalar best = args[0][0];
  Scalar index = emitter.integer(emitter.builder.getIntegerType(32, false), 0);
  for (auto [i, x] : llvm::enumerate(args[0].scalars.drop_front())) {
    Scalar replaces = isBetter(x, best);
    if (x.isFloat())
      replaces = replaces | (isNan(best) & ~isNan(x));
    best = select(replaces, x, best);
    index = select(replaces, index.like(i + 1), index);
  }
  return {index};
}

Scalars lowerArgMin(Emitter &emitter, Operands args) {
  return place(emitter, args, operator<);
}

Scalars lowerArgMax(Emitter &emitter, Operands args) {
  return place(emitter, args, operator>);
}

//===----------------------------------------------------------------------===//
// Matrices
//===----------------------------------------------------------------------===//

Scalars lowerTranspose(Emitter &, Operands args) {
  auto type = cast<MatType>(args[0].type);
  Scalars result;
  for (int64_t j = 0; j < type.getCols(); ++j)
    for (int64_t i = 0; i < type.getRows(); ++i)
      result.push_back(args[0](i, j));
  return result;
}

Scalars lowerGetDiag(Emitter &, Operands args) {
  Scalars result;
  for (int64_t i = 0; i < cast<MatType>(args[0].type).getRows(); ++i)
    result.push_back(args[0](i, i));
  return result;
}

Scalars lowerTrace(Emitter &emitter, Operands args) {
  return {sum(lowerGetDiag(emitter, args))};
}

Scalars lowerDiag(Emitter &, Operands args) {
  size_t n = args[0].size();
  Scalars result(n * n, args[0][0].like(0));
  for (size_t i = 0; i < n; ++i)
    result[i * n + i] = args[0][i];
  return result;
}

} // namespace warp::lowering
