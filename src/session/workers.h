#pragma once
// Two threads for short tasks beside the rendering.

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace etendue {

class Workers {
public:
    static constexpr size_t kThreads = 2, kMostWaiting = 16;

    Workers();
    ~Workers();  ///< Finishes the tasks that have begun, and forgets the others.
    Workers(const Workers&) = delete;
    Workers& operator=(const Workers&) = delete;

    /// False, and the task is not taken, where too many wait already.
    bool post(std::function<void()> task);

private:
    void work();

    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::function<void()>> tasks_;
    bool is_ended_ = false;
    std::vector<std::thread> threads_;
};

}  // namespace etendue
