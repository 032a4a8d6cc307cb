#pragma once
// Structs as bytes, without those that belong to no value.

#include <array>
#include <bit>
#include <cstddef>
#include <type_traits>

namespace etendue {
namespace detail {

/// A constant expression only if no byte is padding, whose value is indeterminate.
template <class T>
consteval int sum_of_bytes() {
    int sum = 0;
    for (const std::byte b : std::bit_cast<std::array<std::byte, sizeof(T)>>(T{})) sum += int(b);
    return sum;
}
template <class T>
inline constexpr bool kIsArray = false;
template <class T, size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;

}  // namespace detail

/// Every byte of a T belongs to a value, so that equal values have equal bytes. T{} must be a constant expression.
template <class T>
concept HasNoPadding = std::is_trivially_copyable_v<T> &&
    (std::has_unique_object_representations_v<T> || std::is_arithmetic_v<T> ||
     requires { typename std::integral_constant<int, detail::sum_of_bytes<T>()>; });

/// Calls `use(part)` for the parts of a value that have no padding, in their order. A struct with padding names its fields
/// by a static for_each_field(struct, use).
template <class T, class Use>
void for_each_part(T& value, const Use& use) {
    using Value = std::remove_const_t<T>;
    static_assert(std::is_trivially_copyable_v<Value>);
    if constexpr (HasNoPadding<Value>)
        use(value);
    else if constexpr (detail::kIsArray<Value>)
        for (auto& element : value) for_each_part(element, use);
    else
        Value::for_each_field(value, [&](auto& field) { for_each_part(field, use); });
}

}  // namespace etendue
