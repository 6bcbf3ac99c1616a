//===- glibc.c - Symbol versions: functions that glibc 2.28 does not have -===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// LLVM's archives and libstdc++.a are compiled against the glibc of this
// machine and call functions that older ones lack or have as macros only.
// These definitions stay local to the library that they are linked into.
//
//===----------------------------------------------------------------------===//

#include <malloc.h>
#include <pthread.h>
#include <stdint.h>
#include <sys/random.h>
#include <sys/stat.h>

// Before 2.33 <sys/stat.h> had these as inline calls of `__xstat`.
int __xstat(int version, const char *path, struct stat *result);
int __lxstat(int version, const char *path, struct stat *result);
int __fxstat(int version, int file, struct stat *result);
int __fxstatat(int version, int folder, const char *path, struct stat *result,
               int flags);
enum { statVersion = 1 };

int stat(const char *path, struct stat *result) {
  return __xstat(statVersion, path, result);
}
int lstat(const char *path, struct stat *result) {
  return __lxstat(statVersion, path, result);
}
int fstat(int file, struct stat *result) {
  return __fxstat(statVersion, file, result);
}
int fstatat(int folder, const char *path, struct stat *result, int flags) {
  return __fxstatat(statVersion, folder, path, result, flags);
}

// 2.36, for std::random_device.
uint32_t arc4random(void) {
  uint32_t bits = 0;
  unsigned got = 0;
  while (got < sizeof(bits)) {
    ssize_t more = getrandom((char *)&bits + got, sizeof(bits) - got, 0);
    if (more > 0)
      got += more;
  }
  return bits;
}

// 2.33, which deprecates the function of 2.28, whose counters have 32 bits.
#pragma clang diagnostic push
#pragma clang diagnostic ignored "-Wdeprecated-declarations"
struct mallinfo2 mallinfo2(void) {
  struct mallinfo old = mallinfo();
  struct mallinfo2 result = {
      (unsigned)old.arena,    (unsigned)old.ordblks, (unsigned)old.smblks,
      (unsigned)old.hblks,    (unsigned)old.hblkhd,  (unsigned)old.usmblks,
      (unsigned)old.fsmblks,  (unsigned)old.uordblks,
      (unsigned)old.fordblks, (unsigned)old.keepcost};
  return result;
}
#pragma clang diagnostic pop

// 2.32, a hint of libstdc++ for reference counts: false is always right.
char __libc_single_threaded = 0;
