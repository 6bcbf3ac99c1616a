//===- ExactSums.h - Reproducible sums, independent of order ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every finite float is a whole multiple of the least subnormal number, so a
// sum of floats can be had exactly, as one long integer. Integer sums have the
// same bits in every order. In a deterministic launch the sum that an element
// of an array receives is kept as digits of 28 bits in words of 64:
//
//   sum = least subnormal * (digit[0] + digit[1] * 2^28 + digit[2] * 2^56 ...)
//
// A float has two digits, a double three. They are added to those of the sum
// without carrying, which 2^35 additions cannot make overflow. After the launch
// one kernel carries, adds the sum to what the element was before the launch,
// and rounds once.
//
// Digits of the same weight lie together, one for each number; the number of an
// element is its distance from the lowest address of the array, in floats. So
// any view of an array leads to the same sums, and a digit that no update
// touched, which is most of them, is never read.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_EXACTSUMS_H
#define WARP_EXACTSUMS_H

#include <cstdint>

namespace warp {

/// Bits of a digit.
inline constexpr int digitBits = 28;

/// Digits that hold all floats of 32 or 64 bits: from 2^-149 to 2^128, or from
/// 2^-1074 to 2^1024.
inline constexpr int countDigits(int width) { return width == 32 ? 10 : 75; }

/// Marks of touched digits, in `SumDescriptor::touched`.
inline constexpr int countMarks(int width) { return countDigits(width) + 3; }

/// After the digits, one word has a bit for each of these that was added.
inline constexpr int addedInfinity = 1, addedMinusInfinity = 2, addedNaN = 4;

/// Terms that a range of threads on the CPU collects before it adds them.
inline constexpr int termsInBuffer = 256;

/// An array that a launch with exact sums accesses.
struct SummedArray {
  /// Bits of the floats that are summed; 0 if the launch loads or stores.
  int64_t width = 0;
  /// The place of the array's descriptor in the parameter block; whether it is
  /// about the gradient there.
  int64_t descriptor = 0;
  int64_t gradient = 0;
  /// Bytes of an element, and what strides of the descriptor are to be
  /// multiplied by.
  int64_t elementSize = 0;
  int64_t strideScale = 1;
};

/// The record after the arguments for each array that an entry sums into.
struct SumDescriptor {
  /// `countDigits` + 1 words for each number, those of one weight together.
  int64_t *digits = nullptr;
  /// For each weight, whether one of its digits was touched. Then, so that they
  /// begin as 0, `countDigits` less the lowest weight of them and the highest
  /// plus 1.
  int32_t *touched = nullptr;
  /// Lowest address of the array.
  uint64_t base = 0;
  /// Numbers.
  int64_t count = 0;
};

} // namespace warp

#endif // WARP_EXACTSUMS_H
