#pragma once

#include <chrono>
#include <thread>

namespace etendue::test {

/// Waits until a condition holds, at most two minutes: programs with a sanitizer on a busy machine take long. Returns
/// whether it does.
template <class Condition>
bool wait_for(const Condition& condition) {
    using namespace std::chrono_literals;
    for (const auto end = std::chrono::steady_clock::now() + 120s; !condition();) {
        if (std::chrono::steady_clock::now() > end) return false;
        std::this_thread::sleep_for(5ms);
    }
    return true;
}

}  // namespace etendue::test
