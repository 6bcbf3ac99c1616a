//===- Kernel.h - A kernel and its compiled variants ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel owns its module and whatever was compiled from it. `launch` takes a
// packed parameter block (see "warp/Launch.h"), derives from it which variant
// fits (launch rank, packed arrays, 32-bit indices), gets that variant from
// memory, from the disk cache or from the compiler, and runs it: on the CPU
// over the thread pool, to completion; on CUDA on a stream.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_KERNEL_H
#define WARP_KERNEL_H

#include "warp/Compile.h"
#include "warp/Device.h"
#include "warp/Export.h"
#include "warp/Launch.h"

#include <memory>
#include <string>
#include <vector>

namespace warp {

/// Extents of a launch.
struct LaunchDim {
  int rank = 1;
  int64_t extent[maxRank] = {0, 0, 0, 0};
};

/// Options of a kernel's code that the caller may choose.
struct KernelOptions {
  bool debug = false;
  bool fastMath = false;
  /// Sums have the same bits in every run.
  bool deterministic = false;
  /// Deterministic: also the same on every device. Sums are exact on the CPU as
  /// they are on a GPU, where else they are made in one order.
  bool sameOnDevices = false;
  /// CPU: most threads of a launch that make updates that tell who came first
  /// in their order, so one core runs kernels that use what atomics return.
  int64_t orderedSlots = 0;
  bool lineinfo = false;
  int optLevel = 2;
  /// Launches may begin with code that is compiled quickly, and get what
  /// `optLevel` gives when they have run for a while (FirstCode.h).
  bool quickFirst = false;
  /// On GPUs, machine code from the driver's linker may run first, where
  /// `quickFirst` is false, too.
  bool linkedFirst = false;
  int blockDim = 256;
  int maxRegisters = 0;
  /// CUDA launch bounds: most threads of a block, and fewest blocks that a
  /// multiprocessor shall hold at a time; 0 leaves it open.
  int maxThreads = 0;
  int minBlocks = 0;
  /// CPU: threads that are lanes of a vector together; 0 leaves it open.
  int lanes = 0;

#if __cplusplus >= 202002L // programs of users may be C++17
  bool operator==(const KernelOptions &) const = default;
#endif
};

struct RegionFormula;
struct SavedKernel;
struct SavedVariant;
struct SourceHashes;
struct Translation;
class TranslationClaim;

/// Properties of a kernel's machine code, by the driver.
struct CudaProperties {
  /// Per thread.
  int registers = 0, localMemory = 0;
  /// Bytes per block, not counting what a launch asks for, and in all.
  int sharedMemory = 0, constantMemory = 0;
  /// Largest block that a launch can have.
  int maxThreads = 0;
  /// Architecture that the machine code is for, as 10 * major + minor.
  int binaryVersion = 0;
  /// Threads per block that these numbers are for.
  int blockDim = 0;
  int blocksPerMultiprocessor = 0;
  /// Share of a multiprocessor's threads that can be resident.
  double occupancy = 0;
};

/// How launches of one kind are made: what the compiler decided, and what the
/// runtime adds.
struct LaunchSchedule {
  /// The facts that tell this kind of launch from others.
  std::string launch;
  std::vector<Choice> choices;
  /// The facts that the compiler decided.
  Schedule schedule;
};

class WARP_API Kernel {
public:
  Kernel(Module module, std::string name, KernelOptions options = {});
  /// A kernel from the cache, whose module is parsed when it is asked for.
  Kernel(Translation translation, std::string name, KernelOptions options = {});
  /// A kernel without source; it launches what was saved.
  explicit Kernel(const SavedKernel &saved);
  ~Kernel();
  Kernel(const Kernel &) = delete;
  Kernel &operator=(const Kernel &) = delete;

  const std::string &name() const;
  /// Throws if the kernel has no source.
  const Module &module() const;
  const std::vector<Param> &parameters() const;
  /// One for each array among the arguments, as `accesses` of the module.
  const std::vector<Access> &arrayAccesses() const;
  /// The elements of those arrays; found when first asked for. Nothing is
  /// known of a kernel without source.
  const RegionFormula &regionFormula() const;
  /// All that another process needs to make this kernel again.
  Translation translation() const;
  /// Stores that with notes in the kernel cache and ends the claim. While
  /// launches wait for their code, another thread does this.
  void storeTranslation(std::string name, std::string notes,
                        std::shared_ptr<TranslationClaim> claim) const;
  /// Hashes of the module's text.
  const SourceHashes &sourceHashes() const;
  /// Bytes of the parameter block.
  size_t parameterSize() const;
  KernelOptions options() const;

  struct Variant;

  /// A launch checked and ready to run: `variant` is null if there is nothing
  /// to do.
  struct Plan {
    Variant *variant = nullptr;
    int device = cpuDevice;
    /// CUDA: nobody asked for a block of a certain size.
    bool openBlock = false;
    /// CPU: the variant is for what memory holds now, so for one launch, or
    /// others while `isCurrent`.
    bool readsMemory = false;
    int64_t items = 0;
    /// Bytes of the arrays and their gradients, if the schedule may reverse the
    /// order of blocks.
    int64_t bytes = 0;
    /// CPU: rough operations of the whole launch.
    double work = 0;
  };

  /// Checks the extents, writes them into the block's header and picks the
  /// variant, compiling it if need be. `blockDim` 0 means the kernel's own.
  Plan prepare(int device, const LaunchDim &dim, void *params,
               int blockDim = 0);
  /// The same, but leaves `variant` null if it would have to be compiled or
  /// read from disk (`items` is then above 0).
  Plan tryPrepare(int device, const LaunchDim &dim, void *params,
                  int blockDim = 0);
  /// True if `tryPrepare` would give a plan with a variant that reads memory
  /// again for a launch of the same arguments.
  bool isCurrent(const Plan &plan, const void *params) const;
  /// Runs a plan. CUDA: queued on `stream`, or on the device's current one.
  /// Debug variants get their error record written into the block.
  void run(const Plan &plan, void *params, const Stream *stream = nullptr);
  /// The same at once on the CPU, also while a graph is being recorded, and in
  /// no case noted by a capture.
  void runAtOnce(const Plan &plan, void *params,
                 const Stream *stream = nullptr);
  void launch(int device, const LaunchDim &dim, void *params,
              const Stream *stream = nullptr, int blockDim = 0);
  /// Lets a launch on a GPU wait on the host for its code, which other threads
  /// make, or for launches that do; `plan` is what `tryPrepare` gave. False if
  /// it may not wait. Throws errors of launches that waited.
  bool queue(const Plan &plan, int device, const LaunchDim &dim,
             const void *params, const Stream *stream = nullptr,
             int blockDim = 0);
  /// A launch whose code is made beside that of others; `params` as for
  /// `prepare`.
  struct CodeRequest {
    Kernel *kernel = nullptr;
    int device = cpuDevice;
    LaunchDim dim;
    const void *params = nullptr;
    int blockDim = 0;
  };
  /// Has other threads make code for launches, and waits for it. Throws the
  /// first error when all are done.
  static void makeCode(const std::vector<CodeRequest> &requests);
  /// True if `queue` is to be asked about a launch on a device with a variant.
  static bool mustQueue(int device);

  /// True if a launch gives its thread back at once, or nearly so.
  static bool isShort(const Plan &plan);
  /// True if a plan's code reports errors, for which it writes into the block
  /// of parameters.
  static bool reports(const Plan &plan);
  /// True if a plan's code prints.
  static bool prints(const Plan &plan);

  /// Compiles the variants that a saved module has. `arch` 0 is the CPU. With a
  /// CUDA device, its driver turns the PTX into machine code.
  SavedKernel save(int arch, int device = cpuDevice);
  /// The one variant of a plan; PTX for the architecture of its device.
  SavedKernel save(const Plan &plan);
  /// Lets launches use saved code, before any given earlier. Throws if it was
  /// made from another source, or with options that change results.
  void attach(const SavedKernel &saved);
  /// Compiles, and loads, what an ordinary launch will need.
  void load(int device, int blockDim = 0);
  /// The same for several kernels, on so many threads at most; 0 is one per
  /// processor. Throws the first error when all are done.
  struct LoadRequest {
    Kernel *kernel = nullptr;
    int device = cpuDevice, blockDim = 0;
  };
  static void load(const std::vector<LoadRequest> &requests, int threads = 0);
  /// Compiles if need be.
  CudaProperties cudaProperties(int device, int blockDim = 0);
  /// Threads per block that fill a multiprocessor best, of those that the code
  /// of launches is for, and how many such blocks fill the device. Compiles
  /// that code if there was no launch yet.
  std::pair<int, int> suggestedBlock(int device);

  /// One for each kind of launch made on a device so far; with `dim`, or if
  /// there was none, for one over packed arrays. `arch` 0 is the CPU; any other
  /// needs no such device. Compiles again to find out.
  std::vector<LaunchSchedule> schedules(int device, int arch,
                                        const LaunchDim *dim = nullptr) const;

  /// Options of the variant that a launch of that rank over packed arrays
  /// would get; `arch` 0 is the CPU.
  CompileOptions optionsFor(int arch, int rank) const;
  /// Milliseconds by phase of everything compiled so far.
  std::map<std::string, double> compileTimes() const;

private:
  struct Impl;
  explicit Kernel(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_KERNEL_H
