#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <new>
#include <type_traits>

#include "film/parallel_for.h"

namespace etendue {

/// Number of pixels in a chunk of parallel work on the film. It is fixed, so that sums over chunks do not depend on the
/// threads.
inline constexpr uint64_t kFilmChunk = 4096;

inline uint64_t film_chunks(uint64_t count) {
    return (count + kFilmChunk - 1) / kFilmChunk;
}

/// Calls `body(chunk, begin, end)`, which must be noexcept, in parallel for the chunks first … last-1 of [0, count). Throws
/// nothing, even where there is no memory for parallel tasks: the calling thread then does their work.
template <class Body>
void for_film_chunks(uint64_t count, uint64_t first, uint64_t last, const Body& body) {
    static_assert(std::is_nothrow_invocable_v<const Body&, uint64_t, uint64_t, uint64_t>,
                  "what it throws would be taken for the want of memory for a task");
    std::atomic<uint64_t> next{first};
    const auto work = [&] {
        for (uint64_t chunk; (chunk = next.fetch_add(1, std::memory_order_relaxed)) < last;)
            body(chunk, chunk * kFilmChunk, std::min(count, (chunk + 1) * kFilmChunk));
    };
    const uint64_t threads = uint64_t(ThreadArena::threads_here());
    try {
        parallel_for(std::min(threads, last - first), [&](uint64_t) { work(); });
    } catch (const std::bad_alloc&) {
    }
    work();
}
/// The same for all chunks.
template <class Body>
void for_film_chunks(uint64_t count, const Body& body) {
    for_film_chunks(count, 0, film_chunks(count), body);
}

}  // namespace etendue
