//===- Kernel.cpp - A kernel and its compiled variants --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch goes through three steps: which variant fits (KernelVariants.cpp),
// its code, if there is none yet (KernelCode.cpp), and the run, on CPUs
// (cpu/Kernel.cpp) or GPUs (cuda/Kernel.cpp).
//
// CPU launches below a few ten thousand operations run on the calling thread:
// waking others would cost more than it saves.
//
//===----------------------------------------------------------------------===//

#include "warp/Kernel.h"

#include "BackgroundThread.h"
#include "ExactSums.h"
#include "FileChecks.h"
#include "GraphImpl.h"
#include "KernelImpl.h"
#include "Overlap.h"
#include "PrivateCopies.h"
#include "warp/SavedModule.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

using namespace warp;

/// Operations worth a second thread.
static constexpr double parallelThreshold = 32768;

bool warp::isWorthThreads(double work) { return work >= parallelThreshold; }

Kernel::Kernel(Module module, std::string name, KernelOptions options)
    : impl(std::make_shared<Impl>(std::move(module))) {
  impl->name = std::move(name);
  impl->options = options;
  impl->setParameters(warp::parameters(impl->module));
}

Kernel::Kernel(Translation translation, std::string name, KernelOptions options)
    : impl(std::make_shared<Impl>(std::move(translation), options)) {
  impl->name = std::move(name);
}

Kernel::Impl::Impl(Module module) : module(std::move(module)) {}

Kernel::Impl::Impl(Translation &&translation, const KernelOptions &options)
    : module(nullptr), text(std::move(translation.text)),
      knownHashes(std::move(translation.hashes)), knownRank(translation.rank),
      options(options) {
  std::call_once(hashed, [] {});
  setParameters(std::move(translation.params));
  setAccesses(std::move(translation.accesses));
}

Kernel::Impl::~Impl() {
  Variant *variant = variants.load();
  while (variant)
    delete std::exchange(variant, variant->next);
}

void Kernel::Impl::setParameters(std::vector<Param> list) {
  params = std::move(list);
  paramSize = parameterBytes(params);
  for (size_t i = 0; i < params.size(); ++i) {
    const Param &param = params[i];
    uint64_t bit = i < 64 ? uint64_t(1) << i : 0;
    if (isIntegerScalar(param))
      integers.push_back({param.offset + param.size - 1, bit});
    bool isWhole = param.kind == Param::Kind::Array;
    if (bit && param.kind == Param::Kind::Scalar)
      switches.push_back({param.offset, param.size, false, bit});
    if (bit && isWhole)
      switches.push_back({param.offset, param.elementSize, true, bit});
    for (int64_t offset : param.arrays)
      arrays.push_back({param.offset + offset, isWhole ? bit : 0,
                        isWhole ? param.elementSize : 0});
  }
}

Kernel::~Kernel() = default;

const std::string &Kernel::name() const { return impl->name; }
const Module &Kernel::module() const { return impl->source(); }

const std::vector<Access> &Kernel::arrayAccesses() const {
  impl->findAccesses();
  return impl->accesses;
}

const RegionFormula &Kernel::regionFormula() const {
  return impl->findFormula();
}

const RegionFormula &Kernel::Impl::findFormula() {
  ForkSection section;
  std::call_once(formed, [this] {
    if (hasSource())
      formula = warp::regionFormula(source());
    else
      formula.isOpen = true;
  });
  return formula;
}

Translation Kernel::translation() const {
  Translation result;
  result.hashes = impl->hashes(&result.text);
  result.params = impl->params;
  result.accesses = arrayAccesses();
  result.rank = impl->threadRank();
  if (result.text.empty())
    result.text = impl->source().text(/*locations=*/true);
  return result;
}

void Kernel::storeTranslation(std::string name, std::string notes,
                              std::shared_ptr<TranslationClaim> claim) const {
  auto store = [kernel = std::shared_ptr<Kernel>(new Kernel(impl)),
                name = std::move(name), notes = std::move(notes),
                claim = std::move(claim)] {
    Translation translation = kernel->translation();
    translation.notes = notes;
    warp::storeTranslation(name, translation);
  };
  if (!warp::mustQueue())
    return store();
  background::addUrgent(
      [store = std::move(store)] {
        try {
          store();
        } catch (...) {
          // Later processes translate the kernel again.
        }
      },
      /*alsoAtExit=*/true);
}

const SourceHashes &Kernel::sourceHashes() const { return impl->hashes(); }

size_t Kernel::parameterSize() const { return impl->paramSize; }
KernelOptions Kernel::options() const { return impl->options; }

const std::vector<Param> &Kernel::parameters() const { return impl->params; }

std::map<std::string, double> Kernel::compileTimes() const {
  drainLaunches();
  std::lock_guard lock(impl->mutex);
  return impl->times;
}

CompileOptions Kernel::optionsFor(int arch, int rank) const {
  return impl->compileOptions(impl->usualKey(rank), arch);
}

Kernel::Variant *Kernel::Impl::choose(const VariantKey &key, int rank,
                                      int64_t items, bool mayMake) {
  Variant *variant = find(key);
  if (!variant && isHost(key.device))
    variant = findForAnyRows(key, rank, items);
  if (variant && isTooSlow(*variant, items)) {
    if (!mayMake)
      return nullptr;
    improve(*variant);
  }
  return variant || !mayMake ? variant : make(key, items);
}

Kernel::Plan Kernel::Impl::plan(int device, const LaunchDim &dim, void *params,
                                int blockDim, bool mayMake) {
  Plan plan;
  plan.device = device;
  VariantKey key = keyFor(device, dim, params, blockDim, plan);
  if (plan.items == 0)
    return plan;
  plan.openBlock = blockDim <= 0 && options.maxThreads == 0 &&
                   options.blockDim == KernelOptions().blockDim;
  if (!hasAccesses.load(std::memory_order_acquire)) {
    if (!mayMake)
      return plan;
    findAccesses();
  }
  key.disjoint =
      (!isHost(device) || overlapMatters) && areDisjoint(accesses, params);
  LaunchHeader header;
  for (int i = 0; i < dim.rank; ++i)
    header.dim[i] = static_cast<int32_t>(dim.extent[i]);
  std::memcpy(params, &header, sizeof(header));
  // Code that is made now may need more than what is known.
  const LaunchNeeds *known;
  do {
    known = needs.load(std::memory_order_acquire);
    VariantKey needed = key;
    if (known)
      applyNeeds(*known, plan, params, needed);
    plan.variant = choose(needed, dim.rank, plan.items, mayMake);
  } while (known != needs.load(std::memory_order_acquire));
  if (plan.variant) {
    const Schedule &schedule = plan.variant->code.schedule;
    plan.work = schedule.cost * static_cast<double>(plan.items);
    if (schedule.reverseOrder)
      plan.bytes = arrayBytes(params);
  }
  return plan;
}

Kernel::Plan Kernel::tryPrepare(int device, const LaunchDim &dim, void *params,
                                int blockDim) {
  return impl->plan(device, dim, params, blockDim, false);
}

Kernel::Plan Kernel::prepare(int device, const LaunchDim &dim, void *params,
                             int blockDim) {
  return impl->plan(device, dim, params, blockDim, true);
}

bool warp::isCheap(const Kernel::Plan &plan) {
  return !plan.variant || !isHost(plan.device) || !isWorthThreads(plan.work);
}

bool Kernel::isShort(const Plan &plan) {
  return isCheap(plan) || plan.variant->isBrief(plan.items);
}

bool Kernel::Variant::isBrief(int64_t items) const {
  // The order of sums that threads share must not depend on times, and a trial
  // of lanes needs the pool.
  const Schedule &schedule = code.schedule;
  return history.isBrief(items) && !schedule.exclusive && !schedule.atomics &&
         !schedule.usesPrintf && code.sites.empty() &&
         !(trial && trial->takes(items));
}

bool Kernel::prints(const Plan &plan) {
  return plan.variant && plan.variant->code.schedule.usesPrintf;
}

bool Kernel::reports(const Plan &plan) {
  return plan.variant && !plan.variant->code.sites.empty();
}

void Kernel::run(const Plan &plan, void *params, const Stream *stream) {
  if (!plan.variant)
    return;
  TraceScope tracing(plan.device, stream);
  if (tracing)
    tracing->addLaunch(*this, plan, params);
  if (isHost(plan.device))
    if (HostRecorder *recorder = hostRecorder())
      return recorder->launch(*this, plan, params);
  const std::vector<SummedArray> &arrays = plan.variant->code.schedule.sums;
  if (arrays.empty())
    return impl->run(plan, params, stream);
  ExactSums sums(impl->name, plan.device, arrays, params, impl->paramSize,
                 stream);
  impl->run(plan, sums.params(), stream);
  sums.finish();
}

void Kernel::runAtOnce(const Plan &plan, void *params, const Stream *stream) {
  impl->run(plan, params, stream);
}

void Kernel::Impl::run(const Plan &plan, void *params, const Stream *stream) {
  plan.variant->current.load(std::memory_order_acquire)
      ->launch(plan, params, paramSize, stream);
}

void Kernel::launch(int device, const LaunchDim &dim, void *params,
                    const Stream *stream, int blockDim) {
  run(prepare(device, dim, params, blockDim), params, stream);
}

//===----------------------------------------------------------------------===//
// Launches that wait
//===----------------------------------------------------------------------===//

Kernel::Kernel(std::shared_ptr<Impl> impl) : impl(std::move(impl)) {}

bool Kernel::mustQueue(int device) {
  return !isHost(device) && (warp::mustQueue() || hasErrors);
}

bool Kernel::queue(const Plan &plan, int device, const LaunchDim &dim,
                   const void *params, const Stream *stream, int blockDim) {
  if (isHost(device) || plan.items == 0)
    return false;
  drainReady();
  raiseKept();
  bool mayWait = isLazyCompile() && !impl->options.debug &&
                 (!stream || stream->device() == device);
  if (!mayWait || (plan.variant && !warp::mustQueue()))
    return false;
  auto *bytes = static_cast<const char *>(params);
  auto data =
      std::make_shared<std::vector<char>>(bytes, bytes + impl->paramSize);
  std::shared_ptr<CodeTicket::State> code;
  if (!plan.variant) {
    // Errors of the launch itself are raised now.
    impl->checkParameterSize(deviceInfo(device).arch);
    // While code of another launch is made its lock is held.
    if (!impl->hasAccesses.load(std::memory_order_acquire))
      impl->findAccesses();
    code = impl->order({device, dim, data, blockDim, nullptr});
  }
  queueLaunch(
      [kernel = std::shared_ptr<Kernel>(new Kernel(impl)), device, dim, data,
       blockDim, where = laterStream(device, stream)] {
        kernel->launch(device, dim, data->data(), where(), blockDim);
        // The trace of a capture names the kernel.
        keepForCapture(device, [kernel] {});
      },
      std::move(code), impl.get());
  return true;
}

std::shared_ptr<CodeTicket::State> Kernel::Impl::order(Order order) {
  order.ticket = std::make_unique<CodeTicket>();
  std::shared_ptr<CodeTicket::State> code = order.ticket->state();
  std::lock_guard lock(ordersMutex);
  orders.push_back(std::move(order));
  if (!std::exchange(makesOrders, true))
    background::addUrgent([impl = shared_from_this()] { impl->makeOrders(); });
  return code;
}

void Kernel::makeCode(const std::vector<CodeRequest> &requests) {
  std::vector<std::shared_ptr<CodeTicket::State>> codes;
  for (const CodeRequest &request : requests) {
    Impl &impl = *request.kernel->impl;
    impl.checkParameterSize(deviceInfo(request.device).arch);
    if (!impl.hasAccesses.load(std::memory_order_acquire))
      impl.findAccesses();
    auto *bytes = static_cast<const char *>(request.params);
    auto data =
        std::make_shared<std::vector<char>>(bytes, bytes + impl.paramSize);
    codes.push_back(impl.order(
        {request.device, request.dim, data, request.blockDim, nullptr}));
  }
  waitForCode(codes);
}

void Kernel::Impl::makeOrders() {
  for (;;) {
    Order next;
    {
      std::lock_guard lock(ordersMutex);
      if (orders.empty()) {
        makesOrders = false;
        return;
      }
      next = std::move(orders.front());
      orders.pop_front();
    }
    try {
      plan(next.device, next.dim, next.params->data(), next.blockDim,
           /*mayMake=*/true);
      next.ticket->finish(nullptr);
    } catch (...) {
      next.ticket->finish(std::current_exception());
    }
  }
}
