#pragma once

#include <algorithm>
#include <cstdint>

#include <tbb/parallel_for.h>

namespace etendue {

/// Number of pixels in a chunk of parallel work on the film. It is fixed, so that sums over chunks do not depend on the
/// threads.
inline constexpr uint64_t kFilmChunk = 4096;

inline uint64_t film_chunks(uint64_t count) {
    return (count + kFilmChunk - 1) / kFilmChunk;
}

/// Calls `body(chunk, begin, end)` in parallel for the chunks first … last-1 of [0, count).
template <class Body>
void for_film_chunks(uint64_t count, uint64_t first, uint64_t last, const Body& body) {
    tbb::parallel_for(first, last, [&](uint64_t chunk) {
        body(chunk, chunk * kFilmChunk, std::min(count, (chunk + 1) * kFilmChunk));
    });
}
/// The same for all chunks.
template <class Body>
void for_film_chunks(uint64_t count, const Body& body) {
    for_film_chunks(count, 0, film_chunks(count), body);
}

}  // namespace etendue
