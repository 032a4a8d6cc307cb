#pragma once

#include <chrono>
#include <thread>

namespace etendue::test {

/// Waits until a condition holds, at most half a minute. Returns whether it does.
template <class Condition>
bool wait_for(const Condition& condition) {
    using namespace std::chrono_literals;
    for (const auto end = std::chrono::steady_clock::now() + 30s; !condition();) {
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(5ms);
    }
    return true;
}

}  // namespace etendue::test
