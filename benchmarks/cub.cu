// Sorts, scans and sums of CUB, for libraries.py --cub:
//
//   nvcc -O3 -arch=native -shared -Xcompiler -fPIC cub.cu -o libcub_cases.so
//
// Each function asks for temporary memory if `temp` is null, as CUB's do, and
// runs in the default stream. They return a cudaError_t.

#include <cstdint>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_reduce.cuh>
#include <cub/device/device_run_length_encode.cuh>
#include <cub/device/device_scan.cuh>
#include <cub/device/device_segmented_sort.cuh>

// With int32 values; where they are afterwards is of no interest.
#define SORT_PAIRS(name, Key)                                                  \
  extern "C" int sort_pairs_##name(void *temp, size_t *bytes, Key *keys,       \
                                   Key *otherKeys, int *values,                \
                                   int *otherValues, int count) {              \
    cub::DoubleBuffer<Key> bothKeys(keys, otherKeys);                          \
    cub::DoubleBuffer<int> bothValues(values, otherValues);                    \
    return cub::DeviceRadixSort::SortPairs(temp, *bytes, bothKeys, bothValues, \
                                           count);                             \
  }
SORT_PAIRS(uint32, uint32_t)
SORT_PAIRS(uint64, uint64_t)

#define SCAN(name, T)                                                          \
  extern "C" int scan_##name(void *temp, size_t *bytes, const T *in, T *out,   \
                             int count) {                                      \
    return cub::DeviceScan::InclusiveSum(temp, *bytes, in, out, count);        \
  }
SCAN(int32, int)
SCAN(float32, float)
SCAN(float64, double)

extern "C" int sum_float32(void *temp, size_t *bytes, const float *in,
                           float *out, int count) {
  return cub::DeviceReduce::Sum(temp, *bytes, in, out, count);
}

extern "C" int runs_int32(void *temp, size_t *bytes, const int *in, int *values,
                          int *lengths, int *runs, int count) {
  return cub::DeviceRunLengthEncode::Encode(temp, *bytes, in, values, lengths,
                                            runs, count);
}

extern "C" int sort_segments_int32(void *temp, size_t *bytes, const int *keys,
                                   int *outKeys, const int *values,
                                   int *outValues, int count, int segments,
                                   const int *offsets) {
  return cub::DeviceSegmentedSort::SortPairs(temp, *bytes, keys, outKeys,
                                             values, outValues, count, segments,
                                             offsets, offsets + 1);
}
