#pragma once
// Replaces TBB's header for the thread sanitizer: in such a program only Embree's loops have workers of TBB (see
// parallel_for.h), and a worker that leaves an arena would free what the arena's owner has allocated, which is ordered in
// libtbb, where the sanitizer does not see it.

#include <tbb/task_arena.h>

namespace tbb {

/// Observes nothing.
class task_scheduler_observer {
public:
    explicit task_scheduler_observer(task_arena&) {}
    virtual ~task_scheduler_observer() = default;
    virtual void on_scheduler_entry(bool) {}
    void observe(bool) {}
};

}  // namespace tbb
