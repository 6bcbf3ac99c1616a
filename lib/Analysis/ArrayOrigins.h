//===- ArrayOrigins.h - Underlying memory of array values -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An array value is a descriptor. These functions find the memory behind it: by
// the shortest way for views (`rootOf`), by number for the arguments of a
// function and for arrays in structs (`ArrayLeaves`), and through loops,
// branches and calls (`ArrayOrigins`). Nothing is stored, so that passes may
// ask while they change the program, unless an analysis says that nothing
// changes (`freeze`).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_ARRAYORIGINS_H
#define WARP_LIB_ANALYSIS_ARRAYORIGINS_H

#include "mlir/IR/Value.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

#include "llvm/ADT/DenseMap.h"

#include <memory>

namespace warp {

/// The array that views were taken of: an argument, say, or a gradient.
mlir::Value rootOf(mlir::Value array);

/// The array whose gradients these are, perhaps by views; null for any other.
mlir::Value gradientOwner(mlir::Value array);

/// Arrays in a value of this type: 1 for an array, those of all fields for a
/// struct.
unsigned countArrays(mlir::Type type);

/// True if an operation is a call of a function that gets arrays, which may
/// access any element of them.
bool isCallWithArrays(mlir::Operation *op);

/// Array leaves of a function's arguments: arguments in order, and the arrays
/// within a struct in the order of its fields. A leaf is called by its number
/// in that order.
class ArrayLeaves {
public:
  explicit ArrayLeaves(mlir::FunctionOpInterface function);

  unsigned size() const { return count; }
  /// The leaf that an array is or is a view of; no leaf if that depends on
  /// control flow, and for gradients.
  llvm::SmallVector<unsigned, 1> of(mlir::Value array) const;
  /// The first leaf of an argument of the function.
  unsigned getFirst(unsigned argument) const { return first[argument]; }
  /// The user's name of a leaf: `x`, or `state.x`.
  std::string getName(unsigned leaf) const;
  mlir::FunctionOpInterface getFunction() const { return function; }

private:
  mutable mlir::FunctionOpInterface function;
  llvm::SmallVector<unsigned> first;
  unsigned count = 0;
};

/// The elements of a leaf, or their gradients. In an entry function, which has
/// no arguments but a block of parameters, `leaf` is the offset in that.
struct ArrayMemory {
  int64_t leaf;
  bool isGradient;

  bool operator==(const ArrayMemory &other) const {
    return leaf == other.leaf && isGradient == other.isGradient;
  }
  bool operator<(const ArrayMemory &other) const {
    return std::tie(leaf, isGradient) < std::tie(other.leaf, other.isGradient);
  }
};

/// The arrays that a value may stand for.
struct ArrayOrigin {
  /// Sorted, each once.
  llvm::SmallVector<ArrayMemory, 1> memories;
  /// It may be nothing else.
  bool isComplete = true;
};

/// Follows arrays through views, structs, loops, branches, and calls within
/// the module. Where control flow carries several arrays of a type, each may
/// be any of them: an answer may name a memory too many, never one too few
/// if it is complete.
class ArrayOrigins {
public:
  /// `disjoint`: no memory that the launch writes overlaps another one, be it
  /// of elements or of gradients.
  explicit ArrayOrigins(mlir::FunctionOpInterface function,
                        bool disjoint = false);

  /// The program stays as it is as long as this lives: calls are looked for
  /// once instead of once for each array that a function gets, and answers are
  /// kept.
  void freeze();

  ArrayOrigin of(mlir::Value array) const;
  /// True if an element of one may be an element of the other, when one of
  /// them is written.
  bool mayAlias(mlir::Value a, mlir::Value b) const;
  const ArrayLeaves &getLeaves() const { return leaves; }

private:
  ArrayLeaves leaves;
  bool disjoint;
  /// Known if the program is frozen: calls by callee, and answers.
  struct Frozen {
    llvm::DenseMap<mlir::StringAttr, llvm::SmallVector<mlir::Operation *, 2>>
        calls;
    llvm::DenseMap<mlir::Value, ArrayOrigin> known;
  };
  std::unique_ptr<Frozen> frozen;
};

} // namespace warp

#endif // WARP_LIB_ANALYSIS_ARRAYORIGINS_H
