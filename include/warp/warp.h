/*===- warp.h - Saved kernels and graphs from C -------------------*- C -*-===*
 *
 * Part of Warp on MLIR, under the Apache License v2.0.
 *
 * What C, Fortran, Julia or Rust need to run kernels and graphs that Python
 * saved: no C++ type crosses this border, and no exception.
 *
 *   warp_module *module;
 *   warp_kernel *saxpy;
 *   if (warp_module_load("saxpy.warp", &module) ||
 *       warp_module_kernel(module, "saxpy", &saxpy))
 *     return fail(warp_last_error());
 *   warp_argument arguments[] = {warp_vector(x, n, 4), warp_vector(y, n, 4),
 *                                warp_value(&a, 4)};
 *   int64_t extent = n;
 *   if (warp_kernel_launch(saxpy, WARP_CPU, 1, &extent, 3, arguments))
 *     return fail(warp_last_error());
 *
 * Functions that return int return 0 if they did what they are for. Objects
 * are freed by the function of their kind, which takes a null pointer; kernels
 * outlive their module. A module or graph is for one thread at a time; kernels
 * are for any number.
 *
 *===----------------------------------------------------------------------===*/

#ifndef WARP_WARP_H
#define WARP_WARP_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define WARP_C_API __attribute__((visibility("default")))
#else
#define WARP_C_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Devices: the CPU, or the number of a CUDA device. */
#define WARP_CPU (-1)
#define WARP_MAX_RANK 4

typedef struct warp_module warp_module;
typedef struct warp_kernel warp_kernel;
typedef struct warp_graph warp_graph;
typedef struct warp_memory warp_memory;

/* The reason for which the last call of this thread failed; empty before. */
WARP_C_API const char *warp_last_error(void);
/* The release of the package, such as "1.19.0". */
WARP_C_API const char *warp_version(void);

/* Memory of a device. On the CPU any memory will do as well. */
WARP_C_API int warp_memory_allocate(int device, size_t bytes,
                                    warp_memory **memory);
WARP_C_API void *warp_memory_data(const warp_memory *memory);
WARP_C_API void warp_memory_free(warp_memory *memory);
/* Waits for what is queued on the devices before. */
WARP_C_API int warp_copy(void *target, int to, const void *source, int from,
                         size_t bytes);
WARP_C_API int warp_synchronize(int device);

/* A saved module; the file is machine code, so load none of a stranger. */
WARP_C_API int warp_module_load(const char *path, warp_module **module);
WARP_C_API void warp_module_free(warp_module *module);
WARP_C_API int warp_module_kernel(warp_module *module, const char *name,
                                  warp_kernel **kernel);
WARP_C_API void warp_kernel_free(warp_kernel *kernel);

/* An argument: a value if `rank` is 0, an array otherwise. */
typedef struct warp_argument {
  /* Address of the value, or of the first element. */
  const void *data;
  /* Of the value, or of an element. */
  size_t bytes;
  /* The name of the type of the value or element, such as "f32" or "si64";
     null if only sizes are to be compared. */
  const char *type;
  int rank;
  int64_t shape[WARP_MAX_RANK];
  /* In bytes; the array is packed in row-major order if all are 0. */
  int64_t strides[WARP_MAX_RANK];
} warp_argument;

/* Runs a kernel once for each index of a grid, after comparing number, kinds,
   ranks and sizes of arguments with those of the file. On the CPU it is done
   on return, on CUDA it is queued. */
WARP_C_API int warp_kernel_launch(warp_kernel *kernel, int device, int rank,
                                  const int64_t *extents, int count,
                                  const warp_argument *arguments);

/* A saved graph; contents of its arrays are set and read by name. */
WARP_C_API int warp_graph_load(const char *path, int device,
                               warp_graph **graph);
WARP_C_API int warp_graph_set(warp_graph *graph, const char *name,
                              const void *source, size_t bytes);
WARP_C_API int warp_graph_get(warp_graph *graph, const char *name, void *target,
                              size_t bytes);
WARP_C_API int warp_graph_launch(warp_graph *graph);
WARP_C_API void warp_graph_free(warp_graph *graph);

/* A value, and a packed array of one dimension. */
static inline warp_argument warp_value(const void *data, size_t bytes) {
  warp_argument argument = {data, bytes, NULL, 0, {0}, {0}};
  return argument;
}
static inline warp_argument warp_vector(const void *data, int64_t count,
                                        size_t bytes) {
  warp_argument argument = {data, bytes, NULL, 1, {count}, {0}};
  return argument;
}

#ifdef __cplusplus
}
#endif

#endif /* WARP_WARP_H */
