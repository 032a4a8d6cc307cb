#pragma once
// Memory pages.

#include <cstddef>
#include <span>
#include <vector>

namespace etendue {

/// Asks the system to keep the whole huge pages of an array in memory as such. Random accesses to arrays of many
/// megabytes then miss the translation of addresses less. Without effect on small arrays, and where the system has no
/// huge pages.
void prefer_huge_pages(std::span<const std::byte> array);

template <class T>
void prefer_huge_pages(const std::vector<T>& array) {
    prefer_huge_pages(std::as_bytes(std::span(array)));
}

}  // namespace etendue
