#include "film/thread_arena.h"

#include "system/memory_limit.h"
#include "system/threads.h"

namespace etendue {
namespace {

/// How many calls of execute() this thread is in. Where it is in none, TBB has an arena for it that nobody asked for.
thread_local int entries = 0;

/// The number of threads, for whose stacks there is room then.
int threads_with_room(int wanted) {
    const int threads = thread_count(wanted);
    make_room_for_threads(threads);
    return threads;
}

}  // namespace

ThreadArena::ThreadArena(int wanted) : arena_(threads_with_room(wanted)), observer_(arena_) {}

int ThreadArena::threads_here() {
    return entries > 0 ? tbb::this_task_arena::max_concurrency() : 1;
}

ThreadArena::Entry::Entry() {
    ++entries;
}

ThreadArena::Entry::~Entry() {
    --entries;
}

ThreadArena::Observer::Observer(tbb::task_arena& arena) : task_scheduler_observer(arena) {
    observe(true);
}

ThreadArena::Observer::~Observer() {
    observe(false);
}

void ThreadArena::Observer::on_scheduler_entry(bool is_worker) {
    if (!is_worker) return;
    // Until the thread ends, whatever the arenas that it enters: TBB has one set of workers for all of them.
    thread_local const WorkerStack stack;
}

}  // namespace etendue
