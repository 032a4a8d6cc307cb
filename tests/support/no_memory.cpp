// A file of its own: where the operators are inlined, GCC takes malloc and delete for a mismatch.

#include "no_memory.h"

#include <cstdlib>
#include <new>

std::atomic<size_t> etendue::test::size_without_memory{0};
std::atomic<long> etendue::test::blocks_with_memory{0};

void* operator new(size_t size) {
    using namespace etendue::test;
    if (size > 0 && size == size_without_memory.load(std::memory_order_relaxed))
        throw std::bad_alloc();
    if (blocks_with_memory.load(std::memory_order_relaxed) > 0 && --blocks_with_memory == 0)
        throw std::bad_alloc();
    if (void* p = std::malloc(size > 0 ? size : 1)) return p;
    throw std::bad_alloc();
}
// The other forms, by these. Without them the standard library does so, but sanitizers, which compare how a block was obtained and
// given back, bring their own.
void* operator new[](size_t size) {
    return operator new(size);
}
void* operator new(size_t size, const std::nothrow_t&) noexcept {
    return std::malloc(size > 0 ? size : 1);
}
void operator delete(void* p) noexcept {
    std::free(p);
}
void operator delete(void* p, size_t) noexcept {
    std::free(p);
}
void operator delete[](void* p) noexcept {
    std::free(p);
}
void operator delete[](void* p, size_t) noexcept {
    std::free(p);
}
