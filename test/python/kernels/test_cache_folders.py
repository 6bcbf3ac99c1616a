"""Kernel caches on folders that misbehave: full disks, quotas, and network file systems.

A library in front of libc makes calls on files below the cache folder fail or wait.
"""

import shutil
import subprocess

import pytest

import programs
from kernel_cache import PROGRAM

FAULTS = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <unistd.h>

static int is(const char *fault) {
  const char *wanted = getenv("FAULT");
  return wanted && !strcmp(wanted, fault);
}
static int isBelow(const char *path) {
  const char *folder = getenv("WARP_CACHE_PATH");
  return folder && !strncmp(path, folder, strlen(folder));
}
static int isFileBelow(int file) {
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t size = readlink(link, path, sizeof path - 1);
  path[size < 0 ? 0 : size] = 0;
  return isBelow(path);
}
static int fail(int code) {
  errno = code;
  return -1;
}
static int faultOfOpen(const char *path, int flags) {
  static int calls;
  if (!isBelow(path))
    return 0;
  if (is("EACCES") && (flags & O_CREAT))
    return EACCES;
  if (is("ESTALE") && __atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED) % 3 == 0)
    return ESTALE;
  return 0;
}

#define OPEN(name)                                                             \
  int name(const char *path, int flags, ...) {                                 \
    va_list list;                                                              \
    va_start(list, flags);                                                     \
    int mode = va_arg(list, int), code = faultOfOpen(path, flags);             \
    va_end(list);                                                              \
    int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, #name);             \
    return code ? fail(code) : real(path, flags, mode);                        \
  }
OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *bytes, size_t size) {
  ssize_t (*real)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
  if (is("ENOSPC") && isFileBelow(file))
    return size > 64 ? real(file, bytes, 64) : fail(ENOSPC);
  return real(file, bytes, size);
}
int close(int file) {
  int (*real)(int) = dlsym(RTLD_NEXT, "close");
  // Servers say when a file is closed that it is over the quota.
  int isOver = is("EDQUOT") && isFileBelow(file) &&
               (fcntl(file, F_GETFL) & O_ACCMODE) != O_RDONLY;
  int result = real(file);
  return isOver ? fail(EDQUOT) : result;
}
int rename(const char *from, const char *to) {
  int (*real)(const char *, const char *) = dlsym(RTLD_NEXT, "rename");
  static int calls;
  if (isBelow(to) && is("slow"))
    usleep(100000);
  if (isBelow(to) && is("ESTALE") &&
      __atomic_add_fetch(&calls, 1, __ATOMIC_RELAXED) % 2)
    return fail(ESTALE);
  return real(from, to);
}
int flock(int file, int operation) {
  int (*real)(int, int) = dlsym(RTLD_NEXT, "flock");
  return isFileBelow(file) ? fail(ENOLCK) : real(file, operation);
}
int lockf(int file, int command, off_t size) {
  int (*real)(int, int, off_t) = dlsym(RTLD_NEXT, "lockf");
  return isFileBelow(file) ? fail(ENOLCK) : real(file, command, size);
}
"""


@pytest.fixture(scope="module")
def faults(tmp_path_factory):
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("faults")
    (folder / "faults.c").write_text(FAULTS)
    library = folder / "faults.so"
    command = [compiler, "-shared", "-fPIC", "-o", library, folder / "faults.c", "-ldl"]
    subprocess.run(command, check=True)
    return library


@pytest.mark.parametrize("fault", ["ENOSPC", "EDQUOT", "EACCES", "ESTALE", "slow"])
def test_programs_run(faults, tmp_path, fault):
    """Results are right while the folder fails, for two processes at a time, and afterwards."""
    cache = tmp_path / "cache"
    setting = {"LD_PRELOAD": faults, "WARP_CACHE_PATH": cache}
    running = [programs.start(PROGRAM, 6, FAULT=fault, **setting) for _ in range(2)]
    for process in running:
        out, err = process.communicate(timeout=120)
        assert process.returncode == 0, err
        assert out.strip() == "right 6"
        # The reason is said once, not for each kernel.
        assert err.count("kernel cache") <= 1, err
    left = [path for path in cache.rglob("*") if path.name.startswith(".writing-")]
    assert not left
    for _ in range(2):
        status, out, err = programs.run(PROGRAM, 6, **setting)
        assert (status, out.strip()) == (0, "right 6"), err


def test_the_fault_is_noticed(faults, tmp_path):
    """A full disk leaves no entries, and the notice names the folder and the reason."""
    cache = tmp_path / "cache"
    environment = {"LD_PRELOAD": faults, "WARP_CACHE_PATH": cache, "FAULT": "ENOSPC"}
    loud = programs.write_program(PROGRAM.read_text().replace("wp.config.quiet = True", ""))
    status, out, err = programs.run(loud, 6, **environment)
    assert status == 0, err
    text = out + err
    assert "No space left on device" in text and str(cache) in text
    assert not [path for path in cache.rglob("*") if path.suffix in (".code", ".kernel")]
