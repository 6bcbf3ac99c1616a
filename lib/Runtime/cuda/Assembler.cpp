//===- Assembler.cpp - PTX assembly by the toolkit's ptxas ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The program reads and writes files in memory, so nothing is left behind
// however it ends. It is killed when the process exits while somebody waits for
// it. Ctrl-C, which terminals send to all processes of a group, is not for it.
//
//===----------------------------------------------------------------------===//

#include "Assembler.h"

#include "Compiler/Abandon.h"
#include "Support.h"
#include "warp/Device.h"
#include "warp/Forks.h"
#include "warp/LaunchQueue.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <dlfcn.h>
#include <fcntl.h>
#include <mutex>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <utility>

using namespace warp;

extern char **environ;

namespace {
class Descriptor {
public:
  /// With a number above those that a child gets.
  explicit Descriptor(int opened) {
    if (opened < 0)
      return;
    number = fcntl(opened, F_DUPFD_CLOEXEC, 10);
    close(opened);
  }
  Descriptor(const Descriptor &) = delete;
  Descriptor &operator=(const Descriptor &) = delete;
  ~Descriptor() { end(); }
  void end() {
    if (number >= 0)
      close(std::exchange(number, -1));
  }
  int number = -1;
};
} // namespace

static int memoryFile() { return memfd_create("warp-ptx", MFD_CLOEXEC); }

static bool writeAll(int file, std::string_view text) {
  while (!text.empty()) {
    ssize_t written = write(file, text.data(), text.size());
    if (written <= 0)
      return false;
    text.remove_prefix(written);
  }
  return true;
}

static std::vector<char> readAll(int file) {
  struct stat status;
  if (fstat(file, &status) != 0)
    return {};
  std::vector<char> bytes(status.st_size);
  for (size_t done = 0; done < bytes.size();) {
    ssize_t count = pread(file, bytes.data() + done, bytes.size() - done, done);
    if (count <= 0)
      return {};
    done += count;
  }
  return bytes;
}

/// Waits for a child, and kills it if nobody needs it any more. `ended` reads
/// the end of a pipe that the child has the other end of.
static bool succeeds(pid_t child, int ended) {
  // A look at the child, too: others may have the pipe by a fork.
  static constexpr int pause = 50; // Milliseconds.
  for (;;) {
    char text[256];
    pollfd end{ended, POLLIN, 0};
    bool hasEnded = poll(&end, 1, pause) > 0 &&
                    read(ended, text, sizeof(text)) == 0;
    if (isAbandoned())
      kill(child, SIGKILL);
    int status = 0;
    pid_t found = waitpid(child, &status, hasEnded ? 0 : WNOHANG);
    if (found == child)
      return WIFEXITED(status) && WEXITSTATUS(status) == 0;
    // Somebody else has waited for all children: how it ended is not known.
    if (found < 0 && errno != EINTR)
      return false;
  }
}

/// Runs a program, which finds files by their numbers: the first one is 3. True
/// if it succeeds.
/// printed: gets what it prints; -1: nobody does.
static bool run(std::vector<const char *> arguments,
                const std::vector<int> &given, int printed) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0)
    return false;
  Descriptor ended(ends[0]), log(ends[1]);
  if (ended.number < 0 || log.number < 0)
    return false;
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&files, printed < 0 ? log.number : printed,
                                   1);
  posix_spawn_file_actions_adddup2(&files, log.number, 2);
  for (size_t i = 0; i < given.size(); ++i)
    posix_spawn_file_actions_adddup2(&files, given[i], int(3 + i));
  posix_spawnattr_t how;
  posix_spawnattr_init(&how);
  // Threads that compile block all signals.
  sigset_t blocked;
  sigemptyset(&blocked);
  posix_spawnattr_setsigmask(&how, &blocked);
  posix_spawnattr_setpgroup(&how, 0);
  posix_spawnattr_setflags(&how, POSIX_SPAWN_SETSIGMASK |
                                     POSIX_SPAWN_SETPGROUP);
  pid_t child = 0;
  int failed = posix_spawn(&child, arguments[0], &files, &how,
                           const_cast<char **>(arguments.data()), environ);
  posix_spawnattr_destroy(&how);
  posix_spawn_file_actions_destroy(&files);
  log.end();
  return !failed && succeeds(child, ended.number);
}

//===----------------------------------------------------------------------===//
// Choice of the program
//===----------------------------------------------------------------------===//

/// A file, nothing, or "auto".
static ForkMutex &settingMutex() {
  static auto *mutex = new ForkMutex;
  return *mutex;
}
static std::string setting = "auto";

/// Version of CUDA, as 1000 * major + 10 * minor; 0 if it does not say.
static int releaseOf(const std::string &program) {
  Descriptor output(memoryFile());
  if (output.number < 0 ||
      !run({program.c_str(), "--version"}, {}, output.number))
    return 0;
  std::vector<char> bytes = readAll(output.number);
  std::string text(bytes.begin(), bytes.end());
  int major = 0, minor = 0;
  size_t at = text.find("release ");
  if (at == text.npos ||
      std::sscanf(text.c_str() + at, "release %d.%d", &major, &minor) != 2)
    return 0;
  return 1000 * major + 10 * minor;
}

/// The folder that packages of Python are in, if the library is in one.
static std::string packageFolder() {
  Dl_info info;
  if (!dladdr(reinterpret_cast<const void *>(&packageFolder), &info) ||
      !info.dli_fname)
    return "";
  std::string path = info.dli_fname;
  for (int i = 0; i < 2; ++i)
    path.resize(std::min(path.size(), path.rfind('/')));
  return path;
}

/// Files that may be the program, the likeliest first.
static std::vector<std::string> candidates() {
  std::vector<std::string> found;
  auto add = [&](std::string folder, const char *rest) {
    std::string file = std::move(folder) + rest;
    char real[PATH_MAX];
    if (access(file.c_str(), X_OK) == 0 && realpath(file.c_str(), real) &&
        std::find(found.begin(), found.end(), real) == found.end())
      found.emplace_back(real);
  };
  for (const char *variable : {"CUDA_HOME", "CUDA_PATH"})
    if (const char *home = std::getenv(variable); home && *home)
      add(home, "/bin/ptxas");
  const char *path = std::getenv("PATH");
  for (std::string_view rest = path ? path : ""; !rest.empty();) {
    size_t end = std::min(rest.find(':'), rest.size());
    // A relative one means another file wherever the program goes.
    if (rest[0] == '/')
      add(std::string(rest.substr(0, end)), "/ptxas");
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  add("/usr/local/cuda", "/bin/ptxas");
  std::string packages = packageFolder();
  for (const char *rest :
       {"/nvidia/cu13/bin/ptxas", "/nvidia/cuda_nvcc/bin/ptxas",
        "/triton/backends/nvidia/bin/ptxas"})
    add(packages, rest);
  return found;
}

namespace {
struct Program {
  std::string file;
  int release = 0;
};
} // namespace

/// The program whose release is the driver's, or else the newest before it.
/// The driver may not take the code of newer ones.
static Program choose(const std::string &given) {
  int driver = cudaDriverVersion();
  Program best;
  for (const std::string &file :
       given == "auto" ? candidates() : std::vector<std::string>{given}) {
    int release = file.empty() ? 0 : releaseOf(file);
    if (release <= driver && release > best.release)
      best = {file, release};
    if (release == driver)
      break;
  }
  return best;
}

/// Failures in turn after which the program is not asked again.
static constexpr int mostFailures = 3;
static std::atomic<int> failures{0};

/// Looked for when first asked.
static Program program() {
  static bool isKnown = false;
  static auto *known = new Program;
  static auto *knownFor = new std::string;
  std::lock_guard lock(settingMutex());
  if (!isKnown || *knownFor != setting) {
    *known = choose(setting);
    *knownFor = setting;
    isKnown = true;
    failures = 0;
  }
  return *known;
}

void warp::setAssembler(std::string file) {
  std::lock_guard lock(settingMutex());
  setting = std::move(file);
}

static bool serves(const Program &program, bool mayBeWorse) {
  return program.release != 0 && failures < mostFailures &&
         (mayBeWorse || program.release == cudaDriverVersion());
}

bool warp::hasAssembler(bool mayBeWorse) {
  return serves(program(), mayBeWorse);
}

/// The first release with levels of effort.
static constexpr int knowsEffort = 13000;

std::optional<AssembledProgram> warp::assembleApart(std::string_view ptx,
                                                    const std::string &target,
                                                    bool mayBeWorse) {
  Program found = program();
  if (!serves(found, mayBeWorse))
    return std::nullopt;
  bool isQuick =
      mayBeWorse && found.release >= knowsEffort && ptx.size() >= longProgram;
  AssembledProgram made;
  made.isBest = found.release == cudaDriverVersion() && !isQuick;
  // The text may end in what ends a string.
  ptx = ptx.substr(0, ptx.find('\0'));
  Descriptor input(memoryFile()), output(memoryFile());
  if (input.number < 0 || output.number < 0 || !writeAll(input.number, ptx) ||
      lseek(input.number, 0, SEEK_SET) != 0)
    return std::nullopt;
  std::string arch = "-arch=" + target;
  std::vector<const char *> arguments{found.file.c_str(), arch.c_str(),
                                      "/proc/self/fd/3", "-o",
                                      "/proc/self/fd/4"};
  // The functions of a program by several threads.
  if (isQuick)
    arguments.insert(arguments.end(),
                     {"--Ofast-compile=min", "--split-compile=4"});
  if (run(std::move(arguments), {input.number, output.number}, /*printed=*/-1))
    made.binary = readAll(output.number);
  if (isAbandoned())
    return std::nullopt;
  if (!isElf(made.binary)) {
    ++failures;
    return std::nullopt;
  }
  failures = 0;
  return made;
}
