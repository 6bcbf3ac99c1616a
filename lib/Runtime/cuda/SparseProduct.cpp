//===- SparseProduct.cpp - A sparse matrix times a vector -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of lib/DeviceLib/cuda/SparseProduct.cpp, whose constants are
// repeated here.
//
//===----------------------------------------------------------------------===//

#include "warp/SparseProduct.h"

#include "LibraryKernels.h"
#include "GraphTrace.h"
#include "warp/Error.h"
#include "warp/Memory.h"

using namespace warp;

static constexpr int threads = 256;
/// Entries and ends of rows that a block takes.
static constexpr int64_t tileLength = 7 * threads;

template <typename T>
static void launch(const QueuedWork &work, const LibraryKernel &kernel,
                   int64_t tiles, const SparseProduct &product, void *sums) {
  launchKernel(work, kernel, tiles, 1, threads, product.offsets,
               product.columns, product.values, int(product.rows), product.x,
               product.y, T(product.alpha), T(product.beta), sums);
}

void warp::multiplyRows(int device, const SparseProduct &product,
                        const Stream *stream) {
  bool isWide = product.kind == NumberType::Float64;
  if (device == cpuDevice)
    throw Error(Error::Kind::Value, "'multiplyRows' is for CUDA devices");
  if (!isWide && product.kind != NumberType::Float32)
    throw Error(Error::Kind::Value, "a sparse product takes floats");
  if (product.rows >= INT32_MAX || product.capacity > INT32_MAX)
    throw Error(Error::Kind::Value,
                "a sparse product takes less than 2^31 rows and entries");
  if (product.rows <= 0)
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::MultiplyRows, product);
  int64_t tiles = ceilDivide(product.rows + product.capacity, tileLength);
  // What a tile publishes: 32 bits of the number in a word.
  Buffer sums(device, tiles * (isWide ? 16 : 8), false, stream);
  setMemory(sums.data(), device, 0, sums.size(), stream);
  QueuedWork work(device, stream);
  LibraryKernel kernel =
      kernelOf(device, "SparseProduct",
               isWide ? "sparse_product_f64" : "sparse_product_f32");
  isWide ? launch<double>(work, kernel, tiles, product, sums.data())
         : launch<float>(work, kernel, tiles, product, sums.data());
}
