#pragma once
#pragma GCC system_header  // #include_next
// Replaces TBB's header for the thread sanitizer, which does not see how libtbb, without instrumentation, passes work
// between threads. This header declares that everything before a loop happens before every call of its body, and every
// call before everything after the loop. It declares no order between two calls, so races between them are found.

#define parallel_for parallel_for_of_tbb
#include_next <tbb/parallel_for.h>
#undef parallel_for

#include <sanitizer/tsan_interface.h>

namespace tbb {

template <class Index, class Body>
struct AnnotatedBody {
    const Body* body;
    char *begin, *end;

    // Not instrumented: this copy was made by another thread, before anything is acquired.
    __attribute__((no_sanitize("thread"))) void operator()(Index i) const {
        __tsan_acquire(begin);
        (*body)(i);
        __tsan_release(end);
    }
};

template <class Index, class Body>
void parallel_for(Index first, Index last, const Body& body) {
    char begin[8], end[8];
    __tsan_release(begin);
    parallel_for_of_tbb(first, last, AnnotatedBody<Index, Body>{&body, begin, end});
    __tsan_acquire(end);
}

}  // namespace tbb
