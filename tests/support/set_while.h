#pragma once
// A switch of what fails in a test.

#include <atomic>

namespace etendue::test {

/// While it exists, `at` has, or counts from, this value; afterwards it is 0.
template <class T>
class SetWhile {
public:
    SetWhile(std::atomic<T>& at, T value) : at_(at) { at_ = value; }
    ~SetWhile() { at_ = 0; }
    SetWhile(const SetWhile&) = delete;
    SetWhile& operator=(const SetWhile&) = delete;
    T now() const { return at_; }

private:
    std::atomic<T>& at_;
};

}  // namespace etendue::test
