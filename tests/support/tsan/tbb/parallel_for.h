#pragma once
// Replaces TBB's header for the thread sanitizer, which does not see how libtbb, without instrumentation, passes work
// between threads: two loops, and their uses of the same stack, would seem unordered. Here every loop has its own threads,
// of which the sanitizer sees everything. Nothing orders two calls of the body, so races between them are found.

#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include <tbb/task_arena.h>

namespace tbb {

template <class Index, class Body>
void parallel_for(Index first, Index last, const Body& body) {
    std::atomic<Index> next{first};
    std::mutex mutex;
    std::exception_ptr error;
    const auto work = [&] {
        for (Index i; (i = next.fetch_add(1, std::memory_order_relaxed)) < last;) {
            try {
                body(i);
            } catch (...) {
                const std::scoped_lock lock(mutex);
                if (!error) error = std::current_exception();
                next.store(last, std::memory_order_relaxed);
            }
        }
    };
    {
        std::vector<std::jthread> threads;
        for (int i = 1; i < this_task_arena::max_concurrency(); ++i) threads.emplace_back(work);
        work();
    }
    if (error) std::rethrow_exception(error);
}

}  // namespace tbb
