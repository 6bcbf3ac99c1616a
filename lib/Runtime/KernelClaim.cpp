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

/// Longest wait for another process of this host, as long as it lives: on a
/// busy machine a kernel takes seconds.
static constexpr std::chrono::seconds patience{10};
/// The same for a process that cannot be looked at.
static constexpr std::chrono::seconds patienceElsewhere{2};

/// Pauses between two looks at a claim: a part of the time that the wait has
/// lasted, so that looks cost little and add little to the wait.
static constexpr std::chrono::microseconds leastPause{250};
static constexpr int partOfWait = 8;

/// How long a process that has compiled nothing yet lets others go first: as
/// long as it waited for the last one, since on a busy machine all take longer.
static constexpr std::chrono::milliseconds leastCourtesy{25}, mostCourtesy{250};
/// For how long after it has waited for one.
static constexpr std::chrono::milliseconds recently{1000};

/// Work that ends sooner was to read an entry that another process had made.
static constexpr std::chrono::milliseconds shortestWork{2};

using Clock = std::chrono::steady_clock;

/// True once this process has compiled: it has paid for what that needs.
static std::atomic<bool> isWarm{false};
/// When this process last waited for another, and for how long.
static std::atomic<Clock::time_point> lastWait{Clock::time_point{}};
static std::atomic<Clock::duration> lastTook{Clock::duration{}};

/// Looks at a claim for one that reads it.
static constexpr int looksPerCheck = 4;

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
  if (stat(file.c_str(), &status) != 0)
    return false;
  auto age = time(nullptr) - status.st_mtime;
  std::ifstream claim(file);
  long process = 0;
  std::string host;
  if (!(claim >> process >> host) || host != hostName())
    return age <= patienceElsewhere.count();
  return age <= patience.count() &&
         (kill(static_cast<pid_t>(process), 0) == 0 || errno == EPERM);
}

/// Sleeps a while in a wait that has begun at a time.
static void pauseSince(Clock::time_point start) {
  std::this_thread::sleep_for(std::max<Clock::duration>(
      leastPause, (Clock::now() - start) / partOfWait));
}

/// Processes that launch the same kernels in step race for each of them. The
/// one that has compiled before goes first: the others would each have to load
/// and start the compiler, which takes as long as a kernel.
static bool letOthersGoFirst(const std::string &wanted) {
  if (isWarm || Clock::now() - lastWait.load() > recently)
    return false;
  auto courtesy =
      std::clamp<Clock::duration>(lastTook, leastCourtesy, mostCourtesy);
  for (auto start = Clock::now(); Clock::now() < start + courtesy;) {
    if (access(wanted.c_str(), F_OK) == 0)
      break;
    pauseSince(start);
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
  auto start = Clock::now(), end = start + patience;
  while (!create(wanted)) {
    if (errno != EEXIST)
      return;
    waited = true;
    // The file says whose it is; most looks only ask if it is there.
    for (int look = 0; look % looksPerCheck || isHonoured(wanted); ++look) {
      if (Clock::now() > end)
        return;
      pauseSince(start);
      if (access(wanted.c_str(), F_OK) != 0)
        break;
    }
    lastWait = Clock::now();
    lastTook = lastWait.load() - start;
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
