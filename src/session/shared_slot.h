#pragma once
// A pointer that threads hand over. libstdc++ 12's std::atomic<std::shared_ptr> is not free of races: its load() releases
// its lock without ordering the read before it.

#include <memory>
#include <mutex>
#include <utility>

namespace etendue {

template <class T>
class SharedSlot {
public:
    explicit SharedSlot(std::shared_ptr<T> value = nullptr) : value_(std::move(value)) {}
    std::shared_ptr<T> load() const {
        const std::lock_guard lock(mutex_);
        return value_;
    }
    void store(std::shared_ptr<T> value) {
        const std::lock_guard lock(mutex_);
        value_.swap(value);
    }

private:
    mutable std::mutex mutex_;
    std::shared_ptr<T> value_;
};

}  // namespace etendue
