// Replaces the functions of TBB's library by which its headers allocate tasks.

#include "no_memory_for_tasks.h"

#include <dlfcn.h>

#include <new>

#include <tbb/parallel_for.h>

std::atomic<long> etendue::test::tasks_with_memory{0};

namespace {

void count_allocation() {
    if (etendue::test::tasks_with_memory.fetch_sub(1) == 1) throw std::bad_alloc();
}
template <class Function>
Function* original(const char* name) {
    return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

namespace tbb::detail::r1 {

void* allocate(d1::small_object_pool*& pool, std::size_t size, const d1::execution_data& data) {
    using Original = void*(d1::small_object_pool*&, std::size_t, const d1::execution_data&);
    static auto* const next = original<Original>(
        "_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEmRKNS2_14execution_dataE");
    count_allocation();
    return next(pool, size, data);
}
void* allocate(d1::small_object_pool*& pool, std::size_t size) {
    using Original = void*(d1::small_object_pool*&, std::size_t);
    static auto* const next =
        original<Original>("_ZN3tbb6detail2r18allocateERPNS0_2d117small_object_poolEm");
    count_allocation();
    return next(pool, size);
}

}  // namespace tbb::detail::r1
