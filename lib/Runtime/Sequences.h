//===- Sequences.h - Inside of scans and sorts ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_SEQUENCES_H
#define WARP_LIB_RUNTIME_SEQUENCES_H

#include "warp/Sequences.h"

namespace warp {

/// cuda/Sort.cpp.
void scanOnCuda(int device, NumberType kind, int width, Sequence out,
                Sequence in, int64_t count, bool inclusive,
                const Stream *stream);
/// Returns whether the result is behind the pairs.
bool sortOnCuda(int device, const Pairs &pairs, int beginBit, int endBit,
                const Stream *stream);
void sortSegmentsOnCuda(int device, const Pairs &pairs, const int32_t *begins,
                        const int32_t *ends, int64_t segments,
                        const Stream *stream);
void findRunsOnCuda(int device, const Runs &runs, const Stream *stream);

} // namespace warp

#endif // WARP_LIB_RUNTIME_SEQUENCES_H
