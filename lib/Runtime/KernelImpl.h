//===- KernelImpl.h - Inside of a kernel ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_KERNELIMPL_H
#define WARP_LIB_RUNTIME_KERNELIMPL_H

#include "WidthPolicy.h"
#include "cuda/Code.h"
#include "cuda/Device.h"
#include "cuda/Driver.h"
#include "warp/FirstCode.h"
#include "warp/Forks.h"
#include "warp/Kernel.h"
#include "warp/Translation.h"

#include <atomic>
#include <functional>
#include <mutex>

namespace warp {

/// What tells the variants of one kernel apart.
struct VariantKey {
  int device = cpuDevice;
  int rank = 1;
  bool index32 = true;
  bool flat = false;
  bool large = false;
  bool underfilled = false;
  bool skinny = false;
  /// `CompileOptions::maxBlockCoarsening`.
  int maxBlockCoarsening = 1;
  bool disjoint = false;
  bool ordered = false;
  /// On a CPU: the launch has so few threads that updates that tell who came
  /// first are in the order of threads.
  bool threadOrder = false;
  /// TMA cannot load boxes of the arrays: their rows are not aligned.
  bool unmapped = false;
  int blockDim = 0;
  /// `CompileOptions::innerExtent`.
  int innerExtent = 0;
  uint64_t contiguous = 0;

  bool operator==(const VariantKey &other) const {
    return device == other.device && rank == other.rank &&
           index32 == other.index32 && flat == other.flat &&
           large == other.large && underfilled == other.underfilled &&
           skinny == other.skinny &&
           maxBlockCoarsening == other.maxBlockCoarsening &&
           disjoint == other.disjoint && ordered == other.ordered &&
           threadOrder == other.threadOrder && unmapped == other.unmapped &&
           blockDim == other.blockDim && innerExtent == other.innerExtent &&
           contiguous == other.contiguous;
  }

  /// The same but for what does not count of the size of the launch, of which
  /// `facts` does.
  bool matches(VariantKey other, int facts) const {
    if (!(facts & largeFact))
      other.large = large;
    if (!(facts & underfilledFact))
      other.underfilled = underfilled;
    if (!(facts & skinnyFact))
      other.skinny = skinny;
    if (!(facts & innerExtentFact))
      other.innerExtent = innerExtent;
    if (!(facts & maxBlockCoarseningFact))
      other.maxBlockCoarsening = maxBlockCoarsening;
    if (!(facts & threadOrderFact))
      other.threadOrder = threadOrder;
    return *this == other;
  }
};

/// What quickly compiled code is, and how better code comes in its place.
struct QuickCode {
  CpuEntry entry = nullptr;
  /// Of the better code.
  CompileOptions wanted;
  /// Nanoseconds on a CPU, or launches on a GPU, that it runs for until better
  /// code is asked for.
  std::atomic<int64_t> patience{0};
  std::function<void()> ask;
  /// Held while better code is made.
  ForkMutex mutex;

  void spend(int64_t amount);
  /// A launch on a GPU.
  void spendLaunch(int64_t threads);
};

/// Code that a CUDA device has, and what launches need to know of it.
struct CudaEntry {
  CudaEntry() = default;
  CudaEntry(const CudaEntry &) = delete;
  CudaEntry &operator=(const CudaEntry &) = delete;
  ~CudaEntry();

  int device = 0;
  CudaCode loaded;
  cuda::Function function = nullptr;
  /// Whether it may start before the kernel before it on its stream has ended.
  bool programmatic = false;
  /// Blocks of the variant's size that a multiprocessor runs at a time, and
  /// blocks of half as many threads; 0 where the code is for one size of
  /// blocks.
  int residentBlocks = 0, residentHalves = 0;
  /// Whether threads keep a stack in memory: some search longer than others,
  /// and a block's room is free when its last thread has ended.
  bool keepsStack = false;
};

struct Kernel::Variant {
  VariantKey key;
  /// Without the binary, which the loader has.
  Code code;
  /// May be exchanged while others run it, for code that does the same.
  std::atomic<CpuEntry> cpu{nullptr};
  /// Whether what runs was compiled quickly.
  std::atomic<bool> isQuick{false};
  /// Stays when better code has come: some may still run it.
  std::unique_ptr<QuickCode> quick;
  /// What its launches taught the thread pool.
  mutable LoopHistory history;
  /// The same on a GPU: one of `entries`, the last. Graphs may have the others.
  std::atomic<const CudaEntry *> cuda{nullptr};
  std::vector<std::unique_ptr<CudaEntry>> entries;
  std::unique_ptr<DeviceErrorRecord> record;
  /// Whether the code counts threads along one axis.
  bool flat = false;
  /// Name of the kernel for the report of a fault.
  const char *label = nullptr;
  /// The variant made before; the list only grows.
  Variant *next = nullptr;

  ~Variant();

  /// Launches on a GPU run it from now on.
  void place(std::unique_ptr<CudaEntry> entry);
  /// On a CPU.
  void run(const void *params, int64_t begin, int64_t end) const;
  /// Whether launches of this kind may run it.
  bool serves(const VariantKey &asked) const {
    return key.matches(asked, code.sizeFacts);
  }
};

struct Kernel::Impl : std::enable_shared_from_this<Kernel::Impl> {
  /// None in a kernel of the cache until `source` is called, which alone reads
  /// it; and none in one that has no source.
  Module module;
  /// Text of the module, where it comes from the cache.
  std::string text;
  std::once_flag parsed, hashed;
  SourceHashes knownHashes;
  /// 0: not known yet.
  std::atomic<int> knownRank{0};
  std::string name;
  KernelOptions options;
  std::vector<Param> params;
  size_t paramSize = 0;
  /// What the kernel does with its arrays; found at the first launch.
  std::vector<Access> accesses;
  std::atomic<bool> hasAccesses{false};
  /// Read without a lock by launches.
  std::atomic<Variant *> variants{nullptr};
  /// Held while a variant is made.
  mutable ForkMutex mutex;
  std::map<std::string, double> times;

  /// Code from files, tried before the compiler.
  std::vector<std::unique_ptr<SavedKernel>> saved;

  explicit Impl(Module module);
  explicit Impl(Translation &&translation);
  ~Impl();
  bool hasSource() const { return !text.empty() || module.getImpl(); }
  /// The module, parsed if need be.
  const Module &source();
  /// `text` gets the text with locations if it is printed for this.
  const SourceHashes &hashes(std::string *text = nullptr);
  /// Dimensions of the thread index that the kernel reads.
  int threadRank();
  void setParameters(std::vector<Param> list);
  Variant *find(const VariantKey &key) const;
  /// One for rows of any length, if the launch is not worth another.
  Variant *findForAnyRows(VariantKey key, int rank, int64_t items) const;
  /// A variant for launches of so many threads.
  Variant *make(const VariantKey &key, int64_t items);
  /// Has quickly compiled code replaced, by the calling thread.
  void improve(Variant &variant);
  Plan plan(int device, const LaunchDim &dim, void *params, int blockDim,
            bool mayMake);
  /// Runs a variant whose parameters are complete.
  void run(const Plan &plan, void *params, const Stream *stream);
  void findAccesses();
  /// True if the threads of a CPU launch of so many make updates that tell who
  /// came first in their order.
  bool isInTurn(int64_t items) const {
    return items <= options.orderedSlots && !options.deterministic;
  }
  /// What counts of the launch's rows on a CPU.
  void setRows(VariantKey &key, const LaunchDim &dim) const;
  bool isDisjoint(const VariantKey &key, const void *params) const;
  VariantKey keyFor(int device, const LaunchDim &dim, const void *params,
                    int blockDim, Plan &plan) const;
  CompileOptions compileOptions(const VariantKey &key, int arch) const;
  /// The key of a launch over packed arrays that do not overlap.
  VariantKey usualKey(int rank) const;
  /// Notes how many threads a launch on a GPU has.
  static void setSize(VariantKey &key, const LaunchDim &dim, int64_t items,
                      int smCount);
  LaunchSchedule describe(const VariantKey &key, int arch,
                          const Variant *variant);
  /// Threads of a block: what a launch asks for, or the kernel's own.
  int checkedBlockDim(int asked) const;
  /// The variant of an ordinary launch.
  Variant &loaded(int device, int blockDim);
  /// Puts saved code into `variant` if some fits; throws if there is no source
  /// to compile either.
  bool obtainSaved(const VariantKey &key, int arch, Variant &variant) const;
  SavedKernel describeSaved(int arch);
  /// With the mutex held.
  SavedVariant compileSaved(const VariantKey &key, int arch);
  /// The saved code for such a launch, and the kernel that it belongs to.
  std::pair<const SavedKernel *, const SavedVariant *>
  chooseSaved(const VariantKey &key, int arch) const;
  [[noreturn]] void raiseNotSaved(const VariantKey &key, int arch) const;
  /// `spent` gets the milliseconds of each phase.
  Code obtain(const CompileOptions &compileOptions,
              std::map<std::string, double> &spent);
  /// Code in the disk cache; nothing if it does not fit this kernel.
  std::optional<Code> findCached(const std::string &key) const;
  /// Whether quick code may do for a launch of so many threads.
  bool mayBeQuick(const VariantKey &key, const CompileOptions &wanted,
                  int64_t items) const;
  /// Code that was compiled quickly, if that does for so many threads.
  FirstCode obtainFirst(const CompileOptions &wanted, int64_t items);
  /// Loads quick code for a GPU; false if the driver does not take it, or not
  /// for blocks of that size.
  bool loadLinked(Variant &variant);
  std::unique_ptr<QuickCode> makeQuick(const CompileOptions &wanted,
                                       Variant &variant);
  void load(Variant &variant);
};

/// Whether a launch of so many threads had better wait for better code: one
/// that a graph records, which keeps the code, has to.
bool isTooSlow(const Kernel::Variant &variant, int64_t items);

Error launchError(Error::Kind kind, const std::string &kernel,
                  const std::string &message);

/// "si32", "ui8": a scalar whose last byte has the highest bit.
bool isIntegerScalar(const Param &param);

/// Runs the indices below `items`; on this thread if `serial`.
void launchOnCpu(const Kernel::Variant &variant, const void *params,
                 size_t paramSize, int64_t items, bool serial);
/// Loads PTX or machine code on the variant's device.
std::unique_ptr<CudaEntry> loadOnCuda(const Kernel::Variant &variant,
                                      Code &code);
/// Unloads it; while a graph is recorded that may use it, later.
void unloadFromCuda(int device, CudaCode loaded);
/// `openBlock`: blocks may be smaller than those that the variant is named for.
/// `bytes`: of all arrays. Of joined blocks the header gets the extents.
void launchOnCuda(const Kernel::Variant &variant, const std::string &name,
                  void *params, const Stream *stream, bool openBlock = false,
                  int64_t bytes = 0);
/// Threads of a block for so many in all: half of the variant's if that keeps
/// more of the card at work.
int chooseBlock(const CudaEntry &entry, int blockDim, int64_t threads,
                int smCount);
/// Whether one grid axis per dimension can express the launch.
bool fitsGrid(const int32_t *dim, int rank, int blockDim);

} // namespace warp

#endif // WARP_LIB_RUNTIME_KERNELIMPL_H
