#pragma once
// Threads for short tasks beside the rendering.

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace etendue {

class Workers {
public:
    static constexpr size_t kMostWaiting = 16;
    enum class AtEnd { ForgetWaiting, FinishAll };

    explicit Workers(size_t threads, AtEnd at_end = AtEnd::ForgetWaiting);
    /// Finishes the tasks that have begun, and forgets the others or finishes them, too.
    ~Workers();
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;

    /// False, and the task is not taken, where too many wait already. Exceptions of the task are ignored.
    bool post(std::function<void()> task);

private:
    void work();
    void end();

    const AtEnd at_end_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::function<void()>> tasks_;
    bool is_ended_ = false;
    std::vector<std::thread> threads_;
};

}  // namespace etendue
