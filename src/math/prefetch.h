#pragma once
// Memory that is read later.

namespace etendue {

/// Asks for the memory of `object`, so that it has come when it is read. Without other effect.
template <class T>
inline void prefetch(const T& object) {
    static_assert(sizeof(T) <= 64, "an object that may lie in more than two cache lines");
    const auto* const begin = reinterpret_cast<const char*>(&object);
    __builtin_prefetch(begin);
    // Whether it may lie in two cache lines.
    if constexpr (alignof(T) < sizeof(T)) __builtin_prefetch(begin + sizeof(T) - 1);
}

}  // namespace etendue
