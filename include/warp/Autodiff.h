//===- Autodiff.h - Automatic differentiation of kernels --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `differentiate` takes the module of a kernel and returns another one, whose
// kernel is compiled and launched like any other:
//
//   reverse   the adjoint. It gets the arguments of the primal launch; seeds
//             and results are the gradients that array descriptors name. The
//             elements that the primal reads are read again; a stored
//             element's gradient is taken and set to zero, a loaded
//             element's is added to.
//   forward   the primal with tangents: every active array has a twin for each
//             direction, an argument after the others, that is read and written
//             like it.
//
// The arrays that are active, that is have gradients, are known here and not at
// run time: there is no code at all for the others. A kernel that needs what
// the primal's arguments don't tell has hidden arguments; the list says what
// to pass for them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_AUTODIFF_H
#define WARP_AUTODIFF_H

#include "warp/Builder.h"
#include "warp/Export.h"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace warp {

struct AutodiffOptions {
  bool forward = false;
  /// Forward mode: how many directions tangents are along.
  int width = 1;
  /// Forward mode: the launch after one whose threads share elements of atomic
  /// minima or maxima. It assigns the tangents of those who have won.
  bool winners = false;
  /// One flag for each array among the arguments, in order, those in structs in
  /// the order of the fields: it has a gradient. Empty: all have.
  std::vector<bool> active;
  /// The same: no element of it is both read and written by a launch. Empty:
  /// that is not known of any.
  std::vector<bool> apart;
  /// For each of them the number of the one to use in its place: a launch may
  /// get one array as several arguments. Empty: all differ.
  std::vector<int> same;
  /// The derivative where a function has none: "pinned", "strict" or
  /// "report". "repeated" is "pinned", and in forward mode threads are counted
  /// that meet repeated singular values or eigenvalues.
  std::string singular = "pinned";
  /// No two arrays of a launch share memory, and no array has an element twice.
  bool unique = true;
  /// Bytes that a loop of known length may keep per thread; longer ones run
  /// parts of the forward sweep again.
  int maxLocalTape = 256;
  /// The strategy of loops with more to keep: "checkpoints" runs parts of the
  /// forward sweep again in memory of a fixed size; "global" keeps all
  /// iterations in memory that the runtime allocates for each launch.
  std::string tape = "checkpoints";
  /// Nobody has kept what the launch has overwritten. Where loops need that,
  /// what the launch has left takes its place, and the launch is refused if a
  /// thread reads an element before it writes it.
  bool unrecorded = false;
};

/// An argument that the primal does not have.
struct HiddenArgument {
  enum class Kind {
    /// A copy of an array as it was before the launch.
    Preserved,
    /// The values that the augmented primal saved, one element for each thread.
    Saved,
    /// Counters of singular points, one for each place, zero at first.
    Counters,
    /// The twin of an active argument in forward mode.
    Tangent,
    /// Zeros, one for each element of an array that has winners, or owners.
    Claims,
    /// Per loop in the global tape (its number is the leaf) and thread, the
    /// trips: zero before the counting launch. Its rank is 4, as of `Saved`.
    Trips,
    /// The same for where the thread's part of the tape begins: the trips of
    /// the threads before it.
    Offsets,
    /// Memory for as many trips of a loop, in rows of 2^16 elements.
    Tape,
  };
  Kind kind = Kind::Preserved;
  /// The array, as numbered by `AutodiffOptions::active`; -1 without.
  int leaf = -1;
  /// The number of a tangent, from 0 to `AutodiffOptions::width` - 1.
  int direction = 0;
  /// Text of the type.
  std::string type;
  /// The source line that each counter is of.
  std::vector<std::string> places;
};

struct Derivative {
  explicit Derivative(Module module) : module(std::move(module)) {}

  Module module;
  /// The primal, changed to fill the `Saved` arguments; it has those too.
  std::optional<Module> augmented;
  /// The kernel that finds how much global tape each thread needs.
  std::optional<Module> counting;
  /// Kernels that run before the derivative if that needs values that the primal
  /// has overwritten: `sizing` writes `Trips`, `recording` is the primal on
  /// copies of what it writes and fills tapes of as many elements. The number of loops
  /// stands for that of the threads, where they have to be told apart: offsets
  /// are 0, 1, ... there. Its `Counters` say how often a thread met what
  /// another one writes: then the derivative is wrong. With the number of an
  /// array they say how often one of its elements was read before it was
  /// written.
  std::optional<Module> sizing, recording;
  /// After the arguments of the primal, in order; those of `counting`, of
  /// `sizing` and of `recording`.
  std::vector<HiddenArgument> hidden, hiddenOfCounting, hiddenOfSizing,
      hiddenOfRecording;
  /// Arrays whose contents the derivative reads.
  std::vector<int> needed;
  /// Not empty if only launches of one thread are right; says why.
  std::string oneThread;
  /// For the user: "file:line:column: gradient stops at ...".
  std::vector<std::string> notices;
  /// Numbers about the code: tape_bytes, replay_loops, atomics, shadowed, ...
  std::map<std::string, int64_t> metrics;
};

/// Throws an `Error` of kind `Compile` that names the source line if the kernel
/// does something active that has no derivative.
WARP_API Derivative differentiate(const Module &module,
                                  const AutodiffOptions &options = {});

} // namespace warp

#endif // WARP_AUTODIFF_H
