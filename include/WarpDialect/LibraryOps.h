//===- LibraryOps.h - Calls of the device library ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_LIBRARYOPS_H
#define WARPDIALECT_LIBRARYOPS_H

#include "WarpDialect/WarpOps.h"

#define GET_OP_CLASSES
#include "WarpDialect/WarpLibraryOps.h.inc"

namespace warp {

/// A function of the device library. Types are letters: i (si32), l (ui64), h
/// (a handle of geometry, ui64), f (f32) and d (f64). In C it takes its
/// operands by value, then a pointer to a struct of its results. One without
/// results changes memory.
///
/// Some have a form for the lanes of a CPU, `symbol_lanes`: all but the first
/// operands are pointers to as many values as lanes, whose number comes next;
/// so are the results. It may be called with anything for lanes that do not
/// run.
struct LibraryFunction {
  /// How GPU kernels get machine code of it: not, beside other functions, or
  /// for its own sake.
  enum class Assembly : uint8_t { None, Short, Long };

  llvm::StringRef symbol, operands, results;
  /// Registers that a thread of a GPU is given where the function searches,
  /// step by step through memory; 0: as many as it likes.
  int registers = 0;
  /// How many operands lanes share there; -1 without that form.
  int shared = -1;
  Assembly assembly = Assembly::None;
  /// True if only targets with products of tiles in their archive have that
  /// machine code.
  bool isProduct = false;
  /// True if it gives the slot of a handle, its first operand.
  bool findsSlot = false;
};

inline constexpr llvm::StringLiteral lanesSuffix = "_lanes";
/// No function: calls with one number give the address of the same memory,
/// which is the thread's own, though its operands are the same everywhere.
inline constexpr llvm::StringLiteral threadMemory = "warp_thread_memory";
/// No function either: 1 in derivatives and in what they repeat of a kernel, 0
/// elsewhere. For values that only derivatives have to reach in a slower way;
/// what a kernel computes must not depend on it.
inline constexpr llvm::StringLiteral isDifferentiated =
    "warp_is_differentiated";
/// Nor is this: 1 in code for CPUs, 0 elsewhere. For what is quicker in kernels
/// there, and in the library on GPUs.
inline constexpr llvm::StringLiteral isCpu = "warp_is_cpu";

/// Returns null if the library has no function of either form.
const LibraryFunction *findLibraryFunction(llvm::StringRef symbol);
/// True if a call gives the address of the slot of a handle.
bool findsSlot(LibraryCallOp call);
/// The type of a letter.
mlir::Type getLibraryType(mlir::MLIRContext *context, char letter);

} // namespace warp

#endif // WARPDIALECT_LIBRARYOPS_H
