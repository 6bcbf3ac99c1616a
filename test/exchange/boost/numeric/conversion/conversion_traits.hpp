//===- conversion_traits.hpp - What OpenVDB's headers take of Boost -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Boost's own header of this name, as Debian 12 has it, is refused by Clang: it
// casts numbers to enumerations that lack them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_EXCHANGE_CONVERSION_TRAITS_HPP
#define WARP_EXCHANGE_CONVERSION_TRAITS_HPP

#include <type_traits>

namespace boost::numeric {

/// The type of two that holds the values of both: of numbers what their sum
/// has, else the one that is no number.
template <class Target, class Source, class = void> struct conversion_traits {
  using supertype =
      std::conditional_t<std::is_arithmetic_v<Target>, Source, Target>;
};
template <class Target, class Source>
struct conversion_traits<
    Target, Source,
    std::enable_if_t<std::is_arithmetic_v<Target> &&
                     std::is_arithmetic_v<Source>>> {
  using supertype = decltype(Target() + Source());
};

} // namespace boost::numeric

#endif // WARP_EXCHANGE_CONVERSION_TRAITS_HPP
