//===- LaunchTimer.cpp - Times of launches between two CUDA events --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Kernel.h"
#include "Support.h"

using namespace warp;

namespace {
/// Two events, which are destroyed with the trial.
class CudaTimer final : public LaunchTimer {
public:
  explicit CudaTimer(CudaDevice &owner) : owner(owner) {
    cuda::ContextScope scope(owner.index);
    for (cuda::EventHandle *event : {&begin, &end})
      WARP_CUDA(eventCreate, event, cuda::eventDefault);
  }
  ~CudaTimer() override {
    for (cuda::EventHandle event : {begin, end})
      if (event)
        cuda::driver()->eventDestroy(event);
  }
  void start(const Stream *stream) override { record(begin, stream); }
  void stop(const Stream *stream) override { record(end, stream); }
  std::optional<double> elapsed() override {
    cuda::ContextScope scope(owner.index);
    float milliseconds = 0;
    if (cuda::driver()->eventQuery(end) != cuda::success)
      return std::nullopt;
    WARP_CUDA(eventElapsedTime, &milliseconds, begin, end);
    return double(milliseconds) * 1e6;
  }

private:
  void record(cuda::EventHandle event, const Stream *stream) {
    QueuedWork work(owner.index, stream);
    WARP_CUDA(eventRecord, event, work.stream());
  }

  CudaDevice &owner;
  cuda::EventHandle begin = nullptr, end = nullptr;
};
} // namespace

std::unique_ptr<LaunchTimer> CudaEntry::makeTimer() const {
  BehindNothing exempt;
  return std::make_unique<CudaTimer>(owner);
}
