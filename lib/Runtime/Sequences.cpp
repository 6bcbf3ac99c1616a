//===- Sequences.cpp - Scans, sorts, runs and sparse products -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Checks of arguments and notes for the trace of a capture; the device does the
// work.
//
//===----------------------------------------------------------------------===//

#include "warp/Sequences.h"

#include "Device.h"
#include "GraphImpl.h"
#include "LaunchQueue.h"
#include "warp/SparseProduct.h"

using namespace warp;

void warp::scanNumbers(int device, NumberType kind, int width, Sequence out,
                       Sequence in, int64_t count, bool inclusive,
                       const Stream *stream) {
  if (count <= 0)
    return;
  if (queueCall(device, stream, [=](const Stream *where) {
        scanNumbers(device, kind, width, out, in, count, inclusive, where);
      }))
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::Scan,
                 graphs::Scan{out, in, count, static_cast<int32_t>(kind), width,
                              inclusive, 0});
  deviceAt(device).scan(kind, width, out, in, count, inclusive, stream);
}

/// Notes a sort that is to be done again; the result is then in both places.
static void note(TraceScope &tracing, const Pairs &pairs, int beginBit,
                 int endBit) {
  if (tracing)
    tracing->add(GraphOperation::Kind::SortPairs,
                 graphs::SortPairs{pairs.keys, pairs.values, pairs.count,
                                   static_cast<int32_t>(pairs.kind),
                                   pairs.valueSize, beginBit, endBit});
}

bool warp::sortPairsAnywhere(int device, const Pairs &pairs, int beginBit,
                             int endBit, const Stream *stream) {
  if (pairs.count <= 1 || beginBit >= endBit)
    return false;
  TraceScope tracing(device, stream);
  note(tracing, pairs, beginBit, endBit);
  return deviceAt(device).sort(pairs, beginBit, endBit, stream);
}

void warp::sortPairs(int device, const Pairs &pairs, int beginBit, int endBit,
                     const Stream *stream) {
  if (pairs.count <= 1 || beginBit >= endBit)
    return;
  if (queueCall(device, stream, [=](const Stream *where) {
        sortPairs(device, pairs, beginBit, endBit, where);
      }))
    return;
  TraceScope tracing(device, stream);
  note(tracing, pairs, beginBit, endBit);
  if (!deviceAt(device).sort(pairs, beginBit, endBit, stream))
    return;
  auto copy = [&](void *to, int64_t bytes) {
    copyMemory(to, device, static_cast<char *>(to) + bytes, device, bytes,
               stream);
  };
  copy(pairs.keys, pairs.count * sizeOf(pairs.kind));
  copy(pairs.values, pairs.count * pairs.valueSize);
}

void warp::sortSegments(int device, const Pairs &pairs, const int32_t *begins,
                        const int32_t *ends, int64_t segments,
                        const Stream *stream) {
  if (queueCall(device, stream, [=](const Stream *where) {
        sortSegments(device, pairs, begins, ends, segments, where);
      }))
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::SortSegments,
                 graphs::SortSegments{pairs.keys, pairs.values, begins, ends,
                                      pairs.count, segments,
                                      static_cast<int32_t>(pairs.kind),
                                      pairs.valueSize});
  deviceAt(device).sortSegments(pairs, begins, ends, segments, stream);
}

void warp::findRuns(int device, const Runs &runs, const Stream *stream) {
  if (runs.count <= 0)
    return setMemory(runs.runCount, device, 0, sizeof(int32_t), stream);
  if (queueCall(device, stream,
                [=](const Stream *where) { findRuns(device, runs, where); }))
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::FindRuns,
                 graphs::FindRuns{runs.numbers, runs.runNumbers,
                                  runs.runLengths, runs.runCount, runs.count,
                                  runs.size});
  deviceAt(device).findRuns(runs, stream);
}

void warp::multiplyRows(int device, const SparseProduct &product,
                        const Stream *stream) {
  if (product.kind != NumberType::Float64 &&
      product.kind != NumberType::Float32)
    throw Error(Error::Kind::Value, "a sparse product takes floats");
  if (product.rows >= INT32_MAX || product.capacity > INT32_MAX)
    throw Error(Error::Kind::Value,
                "a sparse product takes less than 2^31 rows and entries");
  if (product.rows <= 0)
    return;
  if (queueCall(device, stream, [=](const Stream *where) {
        multiplyRows(device, product, where);
      }))
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::MultiplyRows, product);
  deviceAt(device).multiplyRows(product, stream);
}
