#pragma once
#pragma GCC system_header  // #include_next
// Stands before TBB's own header where the thread sanitizer is at work. It cannot see how libtbb, which is not
// instrumented, hands work from thread to thread. Here it is told: what precedes a loop happens before every call of its
// body, and every call before what follows the loop. Nothing is said about two calls, so races between them are found.

#define parallel_for parallel_for_of_tbb
#include_next <tbb/parallel_for.h>
#undef parallel_for

#include <sanitizer/tsan_interface.h>

namespace tbb {

template <class Index, class Body>
struct AnnotatedBody {
    const Body* body;
    char *begin, *end;

    // Not looked into: the copy at hand was made by another thread, before anything is acquired.
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
