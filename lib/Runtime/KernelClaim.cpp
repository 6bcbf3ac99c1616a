//===- KernelClaim.cpp - Claim of one process to compile an entry ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "KernelClaim.h"

#include "warp/KernelCache.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <ctime>
#include <fcntl.h>
#include <fstream>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

using namespace warp;

/// Longest wait for another process, and age of a claim that is not honoured.
static constexpr std::chrono::seconds patience{2};

/// Longest pause between two looks at a claim.
static constexpr std::chrono::milliseconds longestPause{4};

static std::string hostName() {
  char name[256] = {};
  gethostname(name, sizeof(name) - 1);
  return name;
}

/// Creates the file; false with `errno` set if it exists or cannot be made.
static bool create(const std::string &file) {
  int descriptor =
      open(file.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  if (descriptor < 0)
    return false;
  std::string text = std::to_string(getpid()) + " " + hostName() + "\n";
  // A claim that could not be written is honoured for its age alone.
  (void)!write(descriptor, text.data(), text.size());
  close(descriptor);
  return true;
}

/// True while the process that made a claim may still compile.
static bool isHonoured(const std::string &file) {
  struct stat status;
  if (stat(file.c_str(), &status) != 0 ||
      time(nullptr) - status.st_mtime > patience.count())
    return false;
  std::ifstream claim(file);
  long process = 0;
  std::string host;
  if (!(claim >> process >> host) || host != hostName())
    return true;
  return kill(static_cast<pid_t>(process), 0) == 0 || errno == EPERM;
}

KernelClaim::KernelClaim(const std::string &key) {
  KernelCache &cache = KernelCache::get();
  if (!cache.prepareToWrite())
    return;
  std::string wanted = cache.directory() + "/" + key + claimSuffix;
  auto end = std::chrono::steady_clock::now() + patience;
  std::chrono::microseconds pause{250};
  while (!create(wanted)) {
    if (errno != EEXIST)
      return;
    waited = true;
    while (isHonoured(wanted)) {
      if (std::chrono::steady_clock::now() > end)
        return;
      std::this_thread::sleep_for(pause);
      pause = std::min<std::chrono::microseconds>(pause * 2, longestPause);
    }
    // Its process has ended it, or never will.
    if (unlink(wanted.c_str()) != 0)
      return;
  }
  file = std::move(wanted);
}

KernelClaim::~KernelClaim() {
  if (!file.empty())
    unlink(file.c_str());
}
