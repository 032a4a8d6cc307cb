#pragma once
// The parallel loops. No other file includes those of TBB: outside of a ThreadArena, they would begin as many threads as the
// machine has processors, whatever number the user asked for, and end the process where there is no memory for a stack.

#include <tbb/parallel_for.h>

#include "film/thread_arena.h"

namespace etendue {

/// Calls body(i) for all i of [0, count), by the threads of the arena that this thread is in, or by this thread alone.
template <class Index, class Body>
void parallel_for(Index count, const Body& body) {
    if (ThreadArena::threads_here() > 1)
        tbb::parallel_for(Index(0), count, body);
    else
        for (Index i = 0; i < count; ++i) body(i);
}

}  // namespace etendue
