//===- KernelImpl.h - Implementation of kernels -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_KERNELIMPL_H
#define WARP_LIB_RUNTIME_KERNELIMPL_H

#include "Device.h"
#include "ErrorRecords.h"
#include "LaneTrial.h"
#include "LaunchQueue.h"
#include "LaunchTrial.h"
#include "WidthPolicy.h"
#include "WidthSearch.h"
#include "warp/FirstCode.h"
#include "warp/Forks.h"
#include "warp/Kernel.h"
#include "warp/Regions.h"
#include "warp/Translation.h"

#include <array>
#include <atomic>
#include <climits>
#include <deque>
#include <functional>
#include <mutex>

namespace warp {

/// The facts by which the variants of one kernel differ.
struct VariantKey : LaunchFacts {
  int device = cpuDevice;
  /// TMA cannot load tiles of the arrays: their rows are not aligned.
  bool unmapped = false;

  /// True if code of this variant that depends on some facts of the launch's
  /// size may run in launches of the other.
  bool matches(const VariantKey &other, int sizeFacts) const {
    return device == other.device && unmapped == other.unmapped &&
           LaunchFacts::matches(other, sizeFacts);
  }
};

/// Tier-0 code of a variant, and how tier-1 code replaces it.
struct QuickCode {
  /// Options of the tier-1 code.
  CompileOptions wanted;
  /// Nanoseconds on a CPU, or launches on a GPU, that it runs for until better
  /// code is asked for.
  std::atomic<int64_t> patience{0};
  std::function<void()> ask;
  /// Held while tier-1 code is made.
  ForkMutex mutex;

  void spend(int64_t amount);
  /// A launch on a GPU.
  void spendLaunch(int64_t threads, bool isRecorded);
};

/// Code of a variant that a device has loaded.
class DeviceCode {
public:
  DeviceCode() = default;
  DeviceCode(const DeviceCode &) = delete;
  DeviceCode &operator=(const DeviceCode &) = delete;
  virtual ~DeviceCode() = default;

  /// Runs or queues a launch whose parameters are complete.
  virtual void launch(const Kernel::Plan &plan, void *params, size_t paramSize,
                      const Stream *stream) const = 0;
  /// Threads that a block may have.
  virtual int maxThreads() const { return INT_MAX; }
  /// True if faster code for the same variant can be made.
  virtual bool isProvisional() const { return false; }
  /// Registers of a thread and bytes of its local memory; 0 on CPUs.
  virtual std::pair<int, int> threadResources() const { return {0, 0}; }
  /// Adds what the device knows of launches of the code.
  virtual void describe(const VariantKey &, std::vector<Choice> &) const {}
  /// Times launches on the device; null where nothing does.
  virtual std::unique_ptr<LaunchTimer> makeTimer() const { return nullptr; }
};

struct Kernel::Variant {
  VariantKey key;
  /// Without the binary, which the loader has.
  Code code;
  /// The code that launches run, the last of `loaded`. May be exchanged while
  /// others run it, for code that does the same; graphs may have former ones.
  std::atomic<const DeviceCode *> current{nullptr};
  std::vector<std::unique_ptr<DeviceCode>> loaded;
  /// True if tier-0 code runs.
  std::atomic<bool> isQuick{false};
  /// Stays when tier-1 code has come: some may still run it.
  std::unique_ptr<QuickCode> quick;
  /// The check of the lanes, if there is one, and the code of its rounds.
  std::unique_ptr<LaneTrial> trial;
  std::array<std::unique_ptr<DeviceCode>, WidthSearch::most> others;
  /// The lanes that the cost model chose; 0 while they are not known.
  int chosenLanes = 0;
  /// The check of a GPU's schedule, if there is one, the code with the plain
  /// mapping, and the same once launches run that.
  std::unique_ptr<LaunchTrial> launchTrial;
  std::unique_ptr<Variant> plain;
  std::atomic<const Variant *> replacement{nullptr};
  /// PTX that `current` was made of and no machine code is kept of.
  std::shared_ptr<Code> unkept;
  /// Loop times that the thread pool learned from its launches.
  mutable LoopHistory history;
  /// True if the code counts threads along one axis.
  bool flat = false;
  /// Name of the kernel for messages; lives as long as the process.
  const char *label = nullptr;
  /// The variant made before; the list only grows.
  Variant *next = nullptr;

  /// Launches run it from now on.
  void place(std::unique_ptr<DeviceCode> code);
  /// True if launches of so many items were lately over before another thread
  /// would have woken, and nothing is to be learned from the next one.
  bool isBrief(int64_t items) const;
  /// True if launches of this kind may run it.
  bool serves(const VariantKey &asked) const {
    return key.matches(asked, code.schedule.sizeFacts);
  }
};

/// An integer argument: its highest byte tells whether it is negative.
struct IntegerArgument {
  int64_t highByte;
  /// Its bit of `LaunchFacts::nonNegative`.
  uint64_t bit;
};

/// An argument that may leave out code: an integer, or an array of integers.
struct SwitchArgument {
  int64_t offset;
  /// Bytes of the integer, or an element.
  int64_t size;
  bool isArray;
  /// Its bit of `LaunchFacts::zeros`.
  uint64_t bit;
};

/// An array among the arguments, or in a struct among them.
struct ArrayArgument {
  int64_t offset;
  /// Its bit of `LaunchFacts::packed`; none in structs and behind 64 arguments.
  uint64_t bit = 0;
  /// 0 in structs.
  int64_t elementSize = 0;
};

/// Needs of a kernel's code on the arrays of a launch. Launches that do not
/// meet them get a variant that needs less.
struct LaunchNeeds {
  /// Arrays of exact sums overlap no others.
  std::vector<SummedArray> sums;
  /// Arrays lie such that TMA can load tiles of them.
  std::vector<TensorMap> tensorMaps;
  /// Private copies are worth it, by this code's estimates.
  CopiedArrays copied;
  double cost = 1;
  /// Arguments that leave out code where they are zero.
  uint64_t switches = 0;

  /// Adds what code needs; false if it is nothing new.
  bool add(const Schedule &schedule);
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
  /// The arguments from which launches read facts.
  std::vector<IntegerArgument> integers;
  std::vector<ArrayArgument> arrays;
  std::vector<SwitchArgument> switches;
  /// The zeros that there is a version for; none until several launches had
  /// them.
  mutable std::atomic<uint64_t> versionZeros{0};
  mutable std::atomic<int> launchesWithZeros{0};
  /// Accesses of the kernel to its arrays; found at the first launch.
  std::vector<Access> accesses;
  std::atomic<bool> hasAccesses{false};
  /// True if code for CPUs depends on whether they overlap.
  bool overlapMatters = false;
  /// Their elements; found when first asked for.
  std::once_flag formed;
  RegionFormula formula;
  /// Read without a lock by launches.
  std::atomic<Variant *> variants{nullptr};
  /// Held while a variant is made.
  mutable ForkMutex mutex;
  std::map<std::string, double> times;
  /// Needs of all variants: the last of a list that only grows.
  std::atomic<const LaunchNeeds *> needs{nullptr};
  std::vector<std::unique_ptr<LaunchNeeds>> needsMade;

  /// A launch whose code another thread makes.
  struct Order {
    int device;
    LaunchDim dim;
    std::shared_ptr<std::vector<char>> params;
    int blockDim;
    std::unique_ptr<CodeTicket> ticket;
  };
  ForkMutex ordersMutex;
  std::deque<Order> orders;
  /// A thread makes the code of orders, one after the other.
  bool makesOrders = false;

  /// Code from files, tried before the compiler.
  std::vector<std::unique_ptr<SavedKernel>> saved;

  explicit Impl(Module module);
  Impl(Translation &&translation, const KernelOptions &options);
  ~Impl();
  bool hasSource() const { return !text.empty() || module.getImpl(); }
  /// The module, parsed if need be.
  const Module &source();
  /// The result of `compile` for the module; on threads of the background for a
  /// copy, so that no other thread waits meanwhile.
  template <typename Compile> auto compileSource(Compile &&compile);
  std::shared_ptr<CodeTicket::State> order(Order order);
  void makeOrders();
  /// Throws if the arguments are too many for a GPU.
  void checkParameterSize(int arch) const;
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
  const RegionFormula &findFormula();
  void setAccesses(std::vector<Access> list);
  /// True if the threads of a CPU launch of so many make updates that tell who
  /// came first in their order.
  bool isInTurn(int64_t items) const {
    return items <= options.orderedSlots && !options.deterministic;
  }
  /// Sets the facts about the inner extent of a launch on a CPU.
  void setRows(VariantKey &key, const LaunchDim &dim) const;
  /// Weakens the key of a launch that does not have what code needs.
  void applyNeeds(const LaunchNeeds &needs, Plan &plan, const void *params,
                  VariantKey &key) const;
  /// The zeros among the arguments of a launch that code is left out for.
  /// `reads` is set if the memory of an array decided.
  uint64_t findZeros(uint64_t among, const VariantKey &key, const void *params,
                     bool &reads) const;
  /// Has the key say which zeros leave out code, if there is such a version.
  void setZeros(VariantKey &key, uint64_t among, const void *params,
                bool &reads) const;
  /// With the mutex held.
  void noteNeeds(const Schedule &schedule);
  /// The variant of a launch; null if there is none yet and none may be made.
  Variant *choose(const VariantKey &key, int rank, int64_t items, bool mayMake);
  VariantKey keyFor(int device, const LaunchDim &dim, const void *params,
                    int blockDim, Plan &plan) const;
  /// Bytes of the arrays of a launch and their gradients.
  int64_t arrayBytes(const void *params) const;
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
  /// The one made last for a device; null if there is none.
  Variant *findOn(int device) const;
  /// The same with the code that launches run; the one made last, if there is
  /// one for the device.
  Variant &launched(int device);
  VariantKey ordinaryKey(int device, int blockDim);
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
  /// True if tier-0 code may do for a launch of so many threads.
  bool mayBeQuick(const VariantKey &key, const CompileOptions &wanted,
                  int64_t items) const;
  /// Code that was compiled quickly, if that does for so many threads.
  FirstCode obtainFirst(const CompileOptions &wanted, int64_t items);
  /// Loads quick code for a GPU; false if the driver does not take it, or not
  /// for blocks of that size.
  bool loadLinked(Variant &variant);
  std::unique_ptr<QuickCode> makeQuick(const CompileOptions &wanted,
                                       Variant &variant);

  // KernelTrial.cpp
  /// True if the lanes of a variant, or its scalar code, are checked.
  bool mayTry(const CompileOptions &wanted, const Variant &variant) const;
  void startTrial(const CompileOptions &wanted, Variant &variant);
  void resumeTrial(const CompileOptions &wanted, Variant &variant);
  void prepareRound(const CompileOptions &wanted, Variant &variant);
  bool finishRound(const CompileOptions &wanted, Variant &variant,
                   const TrialTimes &times);
  std::vector<TrialTimes> readRounds(const CompileOptions &wanted, int chosen);
  /// The file of a round with so many lanes.
  std::string trialFile(const CompileOptions &wanted, int round, int lanes);
  /// Loads code with so many lanes that launches can run in the same way; null
  /// if there is none.
  std::unique_ptr<DeviceCode> loadLanes(const CompileOptions &wanted,
                                        Variant &variant, int lanes);
  /// Finds out how many lanes the best code of a variant has; false if it
  /// cannot be compared.
  bool findLanes(const CompileOptions &wanted, Variant &variant);
  /// Launches run code that was compared with lanes from now on.
  void finishTrial(Variant &variant, std::unique_ptr<DeviceCode> &code);
  /// The same for schedules on GPUs.
  bool mayTryLaunches(const CompileOptions &wanted,
                      const Variant &variant) const;
  void startLaunchTrial(const CompileOptions &wanted, Variant &variant);
  /// Loads code with the plain mapping; false if there is none, or the
  /// schedule is no other.
  bool loadPlain(const CompileOptions &wanted, Variant &variant);
  /// `wanted`: options of the best code, should it be replaced; null if there
  /// is no source for that.
  void load(Variant &variant, const CompileOptions *wanted);
  /// Loads the best code of a variant, from machine code that is kept if that
  /// is the best.
  std::unique_ptr<DeviceCode> loadBest(Variant &variant, Code &code);
  /// Notes code that the disk cache has no machine code of.
  void setUnkept(Variant &variant, const Code &code);
  /// Has machine code kept for later processes, behind other work, once nothing
  /// takes the loaded code away any more.
  void keepLater(Variant &variant);
};

/// True if a launch of so many threads had better wait for tier-1 code: one
/// that a graph records, which keeps the code, has to.
bool isTooSlow(const Kernel::Variant &variant, int64_t items);

/// True if a launch on a CPU of so many operations is shared by threads.
bool isWorthThreads(double work);
/// True for a launch on a CPU whose cost, as the compiler estimates it, is not
/// worth a second thread, and for all on GPUs.
bool isCheap(const Kernel::Plan &plan);

Error launchError(Error::Kind kind, const std::string &kernel,
                  const std::string &message);

/// "si32", "ui8": a scalar whose last byte has the highest bit.
bool isIntegerScalar(const Param &param);

} // namespace warp

#endif // WARP_LIB_RUNTIME_KERNELIMPL_H
