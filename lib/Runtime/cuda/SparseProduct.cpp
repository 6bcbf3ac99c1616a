//===- SparseProduct.cpp - Load-balanced sparse products on CUDA ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch of lib/DeviceLib/cuda/SparseProduct.cpp.
//
//===----------------------------------------------------------------------===//

#include "warp/SparseProduct.h"
#include "DeviceLib/cuda/LaunchShapes.h"
#include "LibraryKernels.h"

using namespace warp;
using namespace productShape;

template <typename T>
static void launch(const QueuedWork &work, const LibraryKernel &kernel,
                   int64_t tiles, const SparseProduct &product, void *sums) {
  launchKernel(work, kernel, tiles, 1, threads, product.offsets,
               product.columns, product.values, int(product.rows), product.x,
               product.y, T(product.alpha), T(product.beta), sums);
}

void CudaDevice::multiplyRows(const SparseProduct &product,
                              const Stream *stream) {
  bool isWide = product.kind == NumberType::Float64;
  int64_t tiles = ceilDivide(product.rows + product.capacity, tileLength);
  // A tile's part of a row that goes on, in words with 32 bits of the number.
  Buffer sums(index, tiles * (isWide ? 16 : 8), false, stream);
  setMemory(sums.data(), index, 0, sums.size(), stream);
  QueuedWork work(index, stream);
  LibraryKernel kernel =
      kernelOf(index, "SparseProduct",
               isWide ? "sparse_product_f64" : "sparse_product_f32");
  isWide ? launch<double>(work, kernel, tiles, product, sums.data())
         : launch<float>(work, kernel, tiles, product, sums.data());
}
