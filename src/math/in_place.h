#pragma once
// Results that are made where they stay.

#include <optional>
#include <type_traits>
#include <utility>

namespace etendue {

/// An optional with the result of `make`. std::optional(make()) would copy it, and the copy of a large structure stalls on the
/// stores that have just written its members.
template <class Make>
auto optional_of(const Make& make) {
    using Result = std::invoke_result_t<const Make&>;
    struct Maker {
        const Make& make;
        operator Result() const { return make(); }  // makes the value of the optional itself
    };
    return std::optional<Result>(std::in_place, Maker{make});
}

}  // namespace etendue
