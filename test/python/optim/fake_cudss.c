// fake_cudss.c - cuDSS for tests: dense elimination behind its C interface
//
// Pointers are the host's. As the library does, it replaces small pivots and
// never looks for large ones. MINOR_ONLY is the interface before 0.8, whose
// matrices have one type of indices.

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

enum { kOk = 0, kInvalid = 3 };

typedef struct {
  int64_t rows, columns, stride;
  const int *starts, *inner;
  double *values;
  int kind;
} Matrix;

typedef struct {
  int64_t n, entries;
  double *factor;
  int isAnalyzed;
} Data;

// Analyses, factorisations, solutions and objects that live.
int64_t fake_cudss_counts[4];

int cudssGetProperty(int part, int *value) {
#ifdef MINOR_ONLY
  *value = part == 1 ? MINOR_ONLY : 0;
#else
  *value = part == 0;
#endif
  return kOk;
}

int cudssCreate(void **handle) { return *handle = malloc(1), kOk; }
int cudssConfigCreate(void **config) { return *config = malloc(1), kOk; }
int cudssSetStream(void *handle, void *stream) { return kOk; }

int cudssDataCreate(void *handle, void **data) {
  if (!handle)
    return kInvalid;
  *data = calloc(1, sizeof(Data));
  return ++fake_cudss_counts[3], kOk;
}

int cudssDataDestroy(void *handle, void *data) {
  if (!handle)
    return kInvalid;
  free(((Data *)data)->factor);
  free(data);
  return --fake_cudss_counts[3], kOk;
}

int cudssDataGet(void *handle, void *data, int field, void *value, size_t size,
                 size_t *written) {
  if (field != 1 || size != sizeof(int64_t))
    return kInvalid;
  *(int64_t *)value = ((Data *)data)->entries;
  return *written = size, kOk;
}

int cudssMatrixCreateDn(void **made, int64_t rows, int64_t columns,
                        int64_t stride, void *values, int type, int layout) {
  if (type != 1 || layout != 0 || stride < rows)
    return kInvalid;
  Matrix *one = calloc(1, sizeof(Matrix));
  *one = (Matrix){rows, columns, stride, NULL, NULL, values, 0};
  *made = one;
  return ++fake_cudss_counts[3], kOk;
}

int cudssMatrixCreateCsr(void **made, int64_t rows, int64_t columns,
                         int64_t count, void *starts, void *ends, void *inner,
                         void *values,
#ifndef MINOR_ONLY
                         int offsets,
#endif
                         int indices, int type, int kind, int view, int base) {
#ifndef MINOR_ONLY
  if (offsets != 10)
    return kInvalid;
#endif
  if (rows != columns || ends || indices != 10 || type != 1 || base != 0 ||
      view != (kind == 0 ? 0 : 2) || ((int *)starts)[rows] != count)
    return kInvalid;
  Matrix *one = calloc(1, sizeof(Matrix));
  *one = (Matrix){rows, columns, rows, starts, inner, values, kind};
  *made = one;
  return ++fake_cudss_counts[3], kOk;
}

int cudssMatrixDestroy(void *matrix) {
  free(matrix);
  return --fake_cudss_counts[3], kOk;
}

static int factorize(Data *data, const Matrix *a) {
  int64_t n = data->n = a->rows;
  double *f = data->factor = realloc(data->factor, n * n * sizeof(double));
  memset(f, 0, n * n * sizeof(double));
  for (int64_t i = 0; i < n; ++i)
    for (int at = a->starts[i]; at < a->starts[i + 1]; ++at) {
      int64_t j = a->inner[at];
      if (at > a->starts[i] && j <= a->inner[at - 1])
        return kInvalid;
      if (a->kind != 0 && j < i)
        return kInvalid;
      f[i * n + j] = a->values[at];
      if (a->kind != 0)
        f[j * n + i] = a->values[at];
    }
  for (int64_t k = 0; k < n; ++k) {
    if (!(fabs(f[k * n + k]) > 1e-13))
      f[k * n + k] = 1e-13;
    for (int64_t i = k + 1; i < n; ++i) {
      double l = f[i * n + k] /= f[k * n + k];
      for (int64_t j = k + 1; j < n; ++j)
        f[i * n + j] -= l * f[k * n + j];
    }
  }
  data->entries = 0;
  for (int64_t at = 0; at < n * n; ++at)
    data->entries += f[at] != 0;
  return kOk;
}

static void solve(const Data *data, Matrix *x, const Matrix *b) {
  int64_t n = data->n;
  const double *f = data->factor;
  for (int64_t k = 0; k < b->columns; ++k) {
    double *y = x->values + k * x->stride;
    memcpy(y, b->values + k * b->stride, n * sizeof(double));
    for (int64_t i = 0; i < n; ++i)
      for (int64_t j = 0; j < i; ++j)
        y[i] -= f[i * n + j] * y[j];
    for (int64_t i = n - 1; i >= 0; --i) {
      for (int64_t j = i + 1; j < n; ++j)
        y[i] -= f[i * n + j] * y[j];
      y[i] /= f[i * n + i];
    }
  }
}

int cudssExecute(void *handle, int phase, const void *config, void *pointer,
                 const void *matrix, void *x, const void *b) {
  Data *data = pointer;
  if (!handle || !config || !x || !b)
    return kInvalid;
  switch (phase) {
  case 3:
    data->isAnalyzed = 1;
    return ++fake_cudss_counts[0], kOk;
  case 4:
  case 8:
    if (!data->isAnalyzed || (phase == 8 && !data->factor))
      return kInvalid;
    ++fake_cudss_counts[1];
    return factorize(data, matrix);
  case 1008:
    if (!data->factor || ((Matrix *)x)->columns != ((const Matrix *)b)->columns)
      return kInvalid;
    solve(data, x, b);
    return ++fake_cudss_counts[2], kOk;
  }
  return kInvalid;
}
