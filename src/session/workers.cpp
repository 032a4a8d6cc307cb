#include "session/workers.h"

#include <utility>

namespace etendue {

Workers::Workers(size_t threads, AtEnd at_end) : at_end_(at_end) {
    try {
        for (size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
    } catch (...) {
        end();
        throw;
    }
}

Workers::~Workers() {
    end();
}

void Workers::end() {
    {
        const std::lock_guard lock(mutex_);
        is_ended_ = true;
    }
    wake_.notify_all();
    for (std::thread& t : threads_) t.join();
}

bool Workers::post(std::function<void()> task) {
    {
        const std::lock_guard lock(mutex_);
        if (tasks_.size() >= kMostWaiting) return false;
        tasks_.push_back(std::move(task));
    }
    wake_.notify_one();
    return true;
}

void Workers::work() {
    while (true) {
        std::function<void()> task;
        {
            std::unique_lock lock(mutex_);
            wake_.wait(lock, [&] { return is_ended_ || !tasks_.empty(); });
            if (tasks_.empty() || (is_ended_ && at_end_ == AtEnd::ForgetWaiting)) return;
            task = std::move(tasks_.front());
            tasks_.pop_front();
        }
        try {
            task();
        } catch (...) {
            // Such as a lack of memory for the answer, which then is missing.
        }
    }
}

}  // namespace etendue
