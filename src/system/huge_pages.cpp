#include "system/huge_pages.h"

#include <cerrno>
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
    // Advice: where the system refuses it, nothing changes. MADV_HUGEPAGE, which older systems know instead, also holds for
    // what is allocated there later.
    auto* const pages = reinterpret_cast<void*>(begin);
    if (madvise(pages, end - begin, MADV_COLLAPSE) != 0 && errno == EINVAL)
        madvise(pages, end - begin, MADV_HUGEPAGE);
#else
    (void)array;
#endif
}

}  // namespace etendue
