#pragma once

#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

namespace etendue {

/// Threads of parallel loops: the caller of execute(), and workers of TBB, for whose stacks there is memory. Loops outside of
/// any arena have the calling thread alone; see parallel_for.h.
class ThreadArena {
public:
    /// Has thread_count(wanted) threads. Throws std::runtime_error where their stacks do not fit into the memory.
    explicit ThreadArena(int wanted);

    /// Returns task(), whose parallel loops have these threads.
    template <class Task>
    decltype(auto) execute(const Task& task) {
        return arena_.execute([&]() -> decltype(auto) {
            const Entry entry;
            return task();
        });
    }
    /// The number of threads that a parallel loop of this thread has.
    static int threads_here();

private:
    /// While it exists, its thread is in an arena.
    class Entry {
    public:
        Entry();
        ~Entry();
        Entry(const Entry&) = delete;
        Entry& operator=(const Entry&) = delete;
    };
    /// Counts the workers that have begun.
    class Observer final : public tbb::task_scheduler_observer {
    public:
        explicit Observer(tbb::task_arena& arena);
        ~Observer() override;
        void on_scheduler_entry(bool is_worker) override;
    };

    tbb::task_arena arena_;
    Observer observer_;
};

}  // namespace etendue
