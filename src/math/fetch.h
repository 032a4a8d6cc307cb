#pragma once
// Memory that is read later.

namespace etendue {

/// Asks for the memory of `object`, so that it has come when it is read. Without other effect.
template <class T>
inline void fetch(const T& object) {
    const auto* const begin = reinterpret_cast<const char*>(&object);
    __builtin_prefetch(begin);
    // Objects smaller than a cache line may lie in two of them.
    if constexpr (alignof(T) < sizeof(T)) __builtin_prefetch(begin + sizeof(T) - 1);
}

}  // namespace etendue
