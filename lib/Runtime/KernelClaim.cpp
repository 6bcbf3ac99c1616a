//===- KernelClaim.cpp - Claim of one process to compile an entry ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "KernelClaim.h"

#include "warp/KernelCache.h"

#include <algorithm>
#include <atomic>
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

/// How long a process that has compiled nothing yet lets others go first, and
/// for how long after it has waited for one.
static constexpr std::chrono::milliseconds courtesy{25}, recently{1000};

/// Work that ends sooner was to read an entry that another process had made.
static constexpr std::chrono::milliseconds shortestWork{2};

using Clock = std::chrono::steady_clock;

/// True once this process has compiled: it has paid for what that needs.
static std::atomic<bool> isWarm{false};
/// When this process last waited for another.
static std::atomic<Clock::time_point> lastWait{Clock::time_point{}};

/// Looks at a claim for one that reads it.
static constexpr int looksPerCheck = 16;

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

/// Processes that launch the same kernels in step race for each of them. The
/// one that has compiled before goes first: the others would each have to load
/// and start the compiler, which takes as long as a kernel.
static bool letOthersGoFirst(const std::string &wanted) {
  if (isWarm || Clock::now() - lastWait.load() > recently)
    return false;
  for (auto end = Clock::now() + courtesy; Clock::now() < end;) {
    if (access(wanted.c_str(), F_OK) == 0)
      break;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

void KernelClaim::forgetWork() { isWarm = false; }

KernelClaim::KernelClaim(const std::string &key) {
  KernelCache &cache = KernelCache::get();
  if (!cache.prepareToWrite())
    return;
  std::string wanted = cache.directory() + "/" + key + claimSuffix;
  waited = letOthersGoFirst(wanted);
  auto end = std::chrono::steady_clock::now() + patience;
  std::chrono::microseconds pause{250};
  while (!create(wanted)) {
    if (errno != EEXIST)
      return;
    waited = true;
    // The file says whose it is; most looks only ask if it is there.
    for (int look = 0; look % looksPerCheck || isHonoured(wanted); ++look) {
      if (std::chrono::steady_clock::now() > end)
        return;
      std::this_thread::sleep_for(pause);
      pause = std::min<std::chrono::microseconds>(pause * 2, longestPause);
      if (access(wanted.c_str(), F_OK) != 0)
        break;
    }
    lastWait = Clock::now();
    // Its process has ended it, or never will.
    if (unlink(wanted.c_str()) != 0)
      return;
  }
  file = std::move(wanted);
  begin = Clock::now();
}

KernelClaim::~KernelClaim() {
  if (file.empty())
    return;
  unlink(file.c_str());
  if (Clock::now() - begin > shortestWork)
    isWarm = true;
}
