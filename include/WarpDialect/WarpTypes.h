//===- WarpTypes.h - Types of the warp dialect ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The dialect's types, and what the rest of the compiler asks about a type:
// what kind of value it is, how many scalars it holds, how it lies in memory.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_WARPTYPES_H
#define WARPDIALECT_WARPTYPES_H

#include "mlir/IR/BuiltinAttributes.h"
#include "mlir/IR/BuiltinTypes.h"

#define GET_TYPEDEF_CLASSES
#include "WarpDialect/WarpTypes.h.inc"

namespace warp {

/// More components than this in one value are an error, so that no text can
/// make the compiler run out of memory.
constexpr int64_t maxComponents = 1 << 16;

/// `i1`, a signed or unsigned integer of 8 to 64 bits, or a float.
bool isScalar(mlir::Type type);
/// `i1`.
bool isBool(mlir::Type type);
/// A signed or unsigned integer; also a signless one wider than one bit, as
/// thread IR has them.
bool isInteger(mlir::Type type);
bool isFloat(mlir::Type type);
/// A scalar of the dialect or, in thread IR, a signless integer.
bool isThreadScalar(mlir::Type type);
/// A vector, matrix, quaternion or transform.
bool isComposite(mlir::Type type);
/// True if a type has so many numbers that, where they are indexed at run time,
/// memory beats selecting among registers.
bool isLongComposite(mlir::Type type);
/// A scalar, composite or struct.
bool isArrayElement(mlir::Type type);
/// A scalar, composite, array or struct.
bool isValue(mlir::Type type);

/// Scalar type of a scalar or composite; null for everything else.
mlir::Type getElementScalar(mlir::Type type);
/// The same composite or scalar with another scalar type; null if a composite
/// of that kind can't have it.
mlir::Type withElementScalar(mlir::Type type, mlir::Type scalar);
/// The element type of the gradient of an array of such elements: 16-bit
/// floats become f32, everything else stays.
mlir::Type getGradientElement(mlir::Type element);
/// Type that thread IR has for a scalar: integers lose their sign.
mlir::Type getSignless(mlir::Type type);

/// Number of scalars and arrays that a value holds.
int64_t getComponentCount(mlir::Type type);
/// Appends the scalars and arrays of a value, in order.
void flatten(mlir::Type type, llvm::SmallVectorImpl<mlir::Type> &components);
/// Type of component `i`, or of a matrix row if `indices` is 1 for a matrix;
/// null if a composite has no such part.
mlir::Type getIndexedType(mlir::Type composite, size_t indices);
/// Type of a field of a struct, or of the vector "p" or quaternion "q" of a
/// transform; null if there is no such field.
mlir::Type getFieldType(mlir::Type type, llvm::StringRef field);
/// Extents that indices of a composite are within.
llvm::SmallVector<int64_t, 2> getIndexExtents(mlir::Type composite);

/// Layout in memory, that of the C struct. Not for `index`.
int64_t getByteSize(mlir::Type type);
int64_t getByteAlign(mlir::Type type);
/// Offset of a field from the start of its struct.
int64_t getFieldOffset(StructType type, int64_t field);

/// The name that a Python user knows a type by: `vec3f`, `int32`,
/// `array(dtype=float32)`.
std::string getPythonName(mlir::Type type);

} // namespace warp

#endif // WARPDIALECT_WARPTYPES_H
