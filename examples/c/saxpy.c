/* Runs a saved kernel and a saved graph from C.
 *
 *   saxpy MODULE.warp GRAPH.wrp [DEVICE]
 *
 * DEVICE is -1, the CPU, or the number of a CUDA device. The files are those
 * that saxpy_kernels.py writes.
 */

#include "warp/warp.h"

#include <stdio.h>
#include <stdlib.h>

enum { COUNT = 1000 };

static int fail(const char *what) {
  fprintf(stderr, "%s: %s\n", what, warp_last_error());
  return 1;
}

/* y = a x + y by the kernel, on memory of the device. */
static int run_kernel(const char *path, int device, float *x, float *y) {
  warp_module *module;
  warp_kernel *saxpy;
  if (warp_module_load(path, &module))
    return fail("load");
  if (warp_module_kernel(module, "saxpy", &saxpy))
    return fail("kernel");
  warp_module_free(module);

  const size_t bytes = COUNT * sizeof(float);
  warp_memory *left, *right;
  if (warp_memory_allocate(device, bytes, &left) ||
      warp_memory_allocate(device, bytes, &right))
    return fail("allocate");
  void *first = warp_memory_data(left), *second = warp_memory_data(right);
  if (warp_copy(first, device, x, WARP_CPU, bytes) ||
      warp_copy(second, device, y, WARP_CPU, bytes))
    return fail("copy");

  const float a = 2.0f;
  const int64_t extent = COUNT;
  warp_argument arguments[] = {warp_vector(first, COUNT, sizeof(float)),
                               warp_vector(second, COUNT, sizeof(float)),
                               warp_value(&a, sizeof a)};
  arguments[2].type = "f32";
  if (warp_kernel_launch(saxpy, device, 1, &extent, 3, arguments))
    return fail("launch");
  if (warp_copy(y, WARP_CPU, second, device, bytes))
    return fail("copy back");
  warp_memory_free(left);
  warp_memory_free(right);

  /* Each mistake has a message. */
  if (warp_kernel_launch(saxpy, device, 1, &extent, 2, arguments))
    printf("%s\n", warp_last_error());
  arguments[2].type = "si32";
  if (warp_kernel_launch(saxpy, device, 1, &extent, 3, arguments))
    printf("%s\n", warp_last_error());
  warp_kernel_free(saxpy);
  return 0;
}

/* The graph doubles its array "x". */
static int run_graph(const char *path, int device, float *x) {
  warp_graph *graph;
  const size_t bytes = COUNT * sizeof(float);
  if (warp_graph_load(path, device, &graph))
    return fail("load graph");
  if (warp_graph_set(graph, "x", x, bytes) || warp_graph_launch(graph) ||
      warp_graph_launch(graph) || warp_graph_get(graph, "x", x, bytes))
    return fail("run graph");
  warp_graph_free(graph);
  return 0;
}

int main(int count, char **words) {
  if (count < 3) {
    fprintf(stderr, "usage: saxpy MODULE.warp GRAPH.wrp [DEVICE]\n");
    return 2;
  }
  const int device = count > 3 ? atoi(words[3]) : WARP_CPU;
  float x[COUNT], y[COUNT];
  for (int i = 0; i < COUNT; ++i) {
    x[i] = (float)i;
    y[i] = 1.0f;
  }
  if (run_kernel(words[1], device, x, y) || run_graph(words[2], device, x))
    return 1;
  for (int i = 0; i < COUNT; ++i)
    if (y[i] != 2.0f * (float)i + 1.0f || x[i] != 4.0f * (float)i) {
      printf("wrong: element %d is %g and %g\n", i, y[i], x[i]);
      return 1;
    }
  printf("%d elements, release %s\n", COUNT, warp_version());
  return 0;
}
