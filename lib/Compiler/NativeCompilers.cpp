//===- NativeCompilers.cpp - Compilers for user functions -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Clang is a program, NVRTC a library of CUDA's that is loaded when it is first
// needed. Both round each operation by itself, so that devices agree.
//
//===----------------------------------------------------------------------===//

#include "NativeCompilers.h"

#include "warp/Forks.h"
#include "llvm/ADT/SmallVector.h"
#include "llvm/Support/FileSystem.h"
#include "llvm/Support/FileUtilities.h"
#include "llvm/Support/MemoryBuffer.h"
#include "llvm/Support/Path.h"
#include "llvm/Support/Program.h"
#include "llvm/Support/raw_ostream.h"

#include <cstdlib>
#include <dlfcn.h>
#include <stdexcept>

using llvm::StringRef;

static const char *environment(const char *name) {
  const char *value = std::getenv(name);
  return value && *value ? value : nullptr;
}

//===----------------------------------------------------------------------===//
// Clang
//===----------------------------------------------------------------------===//

static std::string findClang() {
  llvm::SmallVector<StringRef> names = {"clang-22", "clang"};
  if (const char *named = environment("WARP_CLANG"))
    names = {named};
  for (StringRef name : names)
    if (auto path = llvm::sys::findProgramByName(name);
        path && llvm::sys::fs::can_execute(*path))
      return *path;
  return "";
}

/// An empty file that is gone with the object.
static llvm::FileRemover makeFile(StringRef ending,
                                  llvm::SmallString<64> &path) {
  if (llvm::sys::fs::createTemporaryFile("warp-native", ending, path))
    throw std::runtime_error("no file can be made in the temporary folder");
  return llvm::FileRemover(path);
}

static std::string readFile(StringRef path) {
  auto buffer = llvm::MemoryBuffer::getFile(path);
  return buffer ? (*buffer)->getBuffer().str() : "";
}

std::string warp::compileForCpu(const NativeCode &code) {
  std::string clang = findClang();
  std::string what = "the native code of '" + code.name + "'";
  if (clang.empty())
    throw std::runtime_error(
        what + " needs Clang: install it, name it in WARP_CLANG, or write the "
               "function in Python with `@wp.func`");
  llvm::SmallString<64> source, made, words;
  auto sourceFile = makeFile("cpp", source), madeFile = makeFile("bc", made),
       wordsFile = makeFile("txt", words);
  {
    std::error_code problem;
    llvm::raw_fd_ostream file(source, problem);
    file << code.text;
  }
  llvm::SmallVector<StringRef> command = {clang,
                                          "-x",
                                          "c++",
                                          "-std=c++17",
                                          "-O2",
                                          "-ffp-contract=off",
                                          "-fno-exceptions",
                                          "-emit-llvm",
                                          "-c",
                                          source,
                                          "-o",
                                          made};
  for (const std::string &folder : code.cpuFolders)
    command.append({"-I", folder});
  std::optional<StringRef> streams[] = {StringRef(), StringRef(),
                                        StringRef(words)};
  std::string failure;
  if (llvm::sys::ExecuteAndWait(clang, command, std::nullopt, streams,
                                /*SecondsToWait=*/0, /*MemoryLimit=*/0,
                                &failure))
    throw std::runtime_error("Clang refuses " + what + ":\n" +
                             StringRef(readFile(words)).trim().str() + failure);
  return readFile(made);
}

//===----------------------------------------------------------------------===//
// NVRTC
//===----------------------------------------------------------------------===//

namespace {

// The names and numbers are those of CUDA's manual.
struct Nvrtc {
  using Program = void *;
  int (*create)(Program *, const char *, const char *, int, const char *const *,
                const char *const *) = nullptr;
  int (*compile)(Program, int, const char *const *) = nullptr;
  int (*sizeOfPtx)(Program, size_t *) = nullptr;
  int (*ptx)(Program, char *) = nullptr;
  int (*sizeOfLog)(Program, size_t *) = nullptr;
  int (*log)(Program, char *) = nullptr;
  int (*destroy)(Program *) = nullptr;
  std::string path;

  bool load(const std::string &library) {
    // Never closed: threads may be inside.
    void *handle = dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (!handle)
      return false;
    auto find = [&](auto &function, const char *name) {
      using Function = std::remove_reference_t<decltype(function)>;
      function = reinterpret_cast<Function>(dlsym(handle, name));
      return function != nullptr;
    };
    bool whole =
        find(create, "nvrtcCreateProgram") &&
        find(compile, "nvrtcCompileProgram") &&
        find(sizeOfPtx, "nvrtcGetPTXSize") && find(ptx, "nvrtcGetPTX") &&
        find(sizeOfLog, "nvrtcGetProgramLogSize") &&
        find(log, "nvrtcGetProgramLog") && find(destroy, "nvrtcDestroyProgram");
    if (whole)
      path = library;
    return whole;
  }
};

struct NvrtcPlaces {
  warp::ForkMutex mutex;
  std::vector<std::string> folders;
  Nvrtc loaded;

  static NvrtcPlaces &get() {
    static NvrtcPlaces places;
    return places;
  }

  /// Null if there is none; folders that come later are looked at, too.
  const Nvrtc *find() {
    std::lock_guard guard(mutex);
    if (!loaded.path.empty())
      return &loaded;
    if (const char *named = environment("WARP_NVRTC"))
      return loaded.load(named) ? &loaded : nullptr;
    static constexpr const char *names[] = {"libnvrtc.so.13", "libnvrtc.so.12",
                                            "libnvrtc.so"};
    for (const std::string &folder : folders)
      for (const char *name : names)
        if (loaded.load(folder + "/" + name))
          return &loaded;
    for (const char *name : names)
      if (loaded.load(name))
        return &loaded;
    for (const char *name : names)
      if (loaded.load(std::string("/usr/local/cuda/lib64/") + name))
        return &loaded;
    return nullptr;
  }
};

} // namespace

void warp::setNvrtcFolders(std::vector<std::string> folders) {
  NvrtcPlaces &places = NvrtcPlaces::get();
  std::lock_guard guard(places.mutex);
  places.folders = std::move(folders);
}

std::string warp::nativeCompiler(bool gpu) {
  if (!gpu)
    return findClang();
  const Nvrtc *nvrtc = NvrtcPlaces::get().find();
  return nvrtc ? nvrtc->path : "";
}

std::string warp::compileForGpu(const NativeCode &code,
                                const std::string &architecture) {
  const Nvrtc *nvrtc = NvrtcPlaces::get().find();
  std::string what = "the native code of '" + code.name + "'";
  if (!nvrtc)
    throw std::runtime_error(
        what + " needs NVRTC on a GPU: install CUDA or the package "
               "nvidia-cuda-nvrtc, name the library in WARP_NVRTC, or write "
               "the function in Python with `@wp.func`");
  Nvrtc::Program program = nullptr;
  if (nvrtc->create(&program, code.text.c_str(), "native.cu", 0, nullptr,
                    nullptr))
    throw std::runtime_error("NVRTC cannot take " + what);
  std::string target = "--gpu-architecture=compute_" +
                       StringRef(architecture).substr(strlen("sm_")).str();
  // Functions that no kernel of theirs calls are kept, too.
  llvm::SmallVector<const char *> options = {
      target.c_str(), "--std=c++17", "--fmad=false",
      "--relocatable-device-code=true", "--device-as-default-execution-space"};
  for (const std::string &folder : code.gpuFolders)
    options.append({"-I", folder.c_str()});
  bool refused =
      nvrtc->compile(program, int(options.size()), options.data()) != 0;
  auto text = [&](auto sizeOf, auto read) {
    size_t size = 0;
    sizeOf(program, &size);
    std::string result(size, '\0');
    read(program, result.data());
    // It ends with a zero.
    result.resize(strlen(result.c_str()));
    return result;
  };
  std::string words = text(nvrtc->sizeOfLog, nvrtc->log);
  std::string ptx = refused ? "" : text(nvrtc->sizeOfPtx, nvrtc->ptx);
  nvrtc->destroy(&program);
  if (refused)
    throw std::runtime_error("NVRTC refuses " + what + ":\n" +
                             StringRef(words).trim().str());
  return ptx;
}
