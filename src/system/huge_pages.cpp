#include "system/huge_pages.h"

#include <cstdint>

#ifdef __linux__
#include <sys/mman.h>
#ifndef MADV_COLLAPSE
#define MADV_COLLAPSE 25  // Linux 6.1; unknown to older headers
#endif
#endif

namespace etendue {

void prefer_huge_pages(std::span<const std::byte> array) {
#ifdef __linux__
    constexpr uintptr_t kHugePage = uintptr_t(1) << 21;
    const auto address = reinterpret_cast<uintptr_t>(array.data());
    const uintptr_t begin = (address + kHugePage - 1) / kHugePage * kHugePage,
                    end = (address + array.size()) / kHugePage * kHugePage;
    if (begin >= end) return;
    // Both are advice: where the system refuses them, nothing changes. The first one holds for pages that are touched
    // later; older systems know only this one.
    auto* const pages = reinterpret_cast<void*>(begin);
    if (madvise(pages, end - begin, MADV_HUGEPAGE) == 0) madvise(pages, end - begin, MADV_COLLAPSE);
#else
    (void)array;
#endif
}

}  // namespace etendue
