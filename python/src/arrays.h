#pragma once
// Arrays of numbers, one row for each ray or point, that functions read and fill.

#include <algorithm>

#include "bindings.h"
#include "film/parallel_for.h"
#include "film/thread_arena.h"

namespace etendue::python {

template <class T, class... Shape>
using Array = nb::ndarray<T, Shape..., nb::c_contig, nb::device::cpu>;
template <class T>
using Column = Array<T, nb::ndim<1>>;
template <class T, int kColumns>
using Rows = Array<T, nb::shape<-1, kColumns>>;

inline Vec3 row(const Rows<const float, 3>& rows, size_t i) {
    const float* v = rows.data() + 3 * i;
    return {v[0], v[1], v[2]};
}
inline void set_row(const Rows<float, 3>& rows, size_t i, Vec3 v) {
    float* const to = rows.data() + 3 * i;
    to[0] = v.x, to[1] = v.y, to[2] = v.z;
}

/// Calls body(first, end) for grains of n rows, by several threads and without the GIL.
template <class Body>
void for_each_grain(size_t n, const Body& body) {
    use_threads();
    const nb::gil_scoped_release no_gil;
    constexpr size_t kGrain = 1024;
    ThreadArena arena(0);
    arena.execute([&] {
        parallel_for((n + kGrain - 1) / kGrain, [&](size_t grain) {
            body(grain * kGrain, std::min(n, (grain + 1) * kGrain));
        });
    });
}
/// The same for each row.
template <class Body>
void for_each_row(size_t n, const Body& body) {
    for_each_grain(n, [&](size_t first, size_t end) {
        for (size_t i = first; i < end; ++i) body(i);
    });
}

}  // namespace etendue::python
