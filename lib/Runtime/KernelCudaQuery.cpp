//===- KernelCudaQuery.cpp - Resources of a CUDA kernel -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "KernelImpl.h"

using namespace warp;

CudaProperties Kernel::cudaProperties(int device, int blockDim) {
  const Variant &variant = impl->loaded(device, blockDim);
  cuda::ContextScope scope(device);
  CudaProperties result;
  cuda::Function function = variant.cuda.load()->function;
  result.registers = attributeOf(function, cuda::functionRegisters);
  result.localMemory = attributeOf(function, cuda::functionLocalSize);
  result.sharedMemory = attributeOf(function, cuda::functionSharedSize) +
                        variant.code.schedule.dynamicBytes;
  result.constantMemory = attributeOf(function, cuda::functionConstantSize);
  result.maxThreads = attributeOf(function, cuda::functionMaxThreads);
  result.binaryVersion = attributeOf(function, cuda::functionBinaryVersion);
  result.blockDim = variant.key.blockDim;
  WARP_CUDA(occupancyMaxActiveBlocks, &result.blocksPerMultiprocessor, function,
            result.blockDim, variant.code.schedule.dynamicBytes);
  int threads = 0;
  WARP_CUDA(deviceGetAttribute, &threads, cuda::maxThreadsPerMultiprocessor,
            cudaDeviceState(device).ordinal);
  if (threads > 0)
    result.occupancy =
        double(result.blocksPerMultiprocessor) * result.blockDim / threads;
  return result;
}

std::pair<int, int> Kernel::suggestedBlock(int device) {
  int most = impl->options.maxThreads ? impl->options.maxThreads : 1024;
  const Variant &variant = impl->loaded(device, most);
  cuda::ContextScope scope(device);
  int blocks = 0, threads = 0;
  WARP_CUDA(occupancyMaxPotentialBlockSize, &blocks, &threads,
            variant.cuda.load()->function, nullptr, 0, most);
  return {threads, blocks};
}
