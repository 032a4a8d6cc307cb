#pragma once
// Failures as text. Where minutes of work would be lost with an exception, it must not matter of which class it is: parts that
// are written in Python, and the standard library, throw others than std::runtime_error.

#include <exception>
#include <new>
#include <string>

namespace etendue {

/// Why the exception was thrown that is being handled; never empty.
inline std::string caught() noexcept {
    try {
        try {
            throw;
        } catch (const std::bad_alloc&) {
            return "not enough memory";
        } catch (const std::exception& e) {
            if (*e.what() != '\0') return e.what();
        } catch (...) {
        }
        return "a failure without a name";
    } catch (const std::bad_alloc&) {
        return "no memory";  // short enough to need none
    }
}

/// Calls `task`. Returns why it failed; empty if it did not.
template <class Task>
std::string failure_of(const Task& task) {
    try {
        task();
        return {};
    } catch (...) {
        return caught();
    }
}

}  // namespace etendue
