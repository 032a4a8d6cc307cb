#include "bindings.h"

namespace etendue::python {
namespace {

template <class T>
FloatArray own(std::vector<T>&& values, std::initializer_list<size_t> shape) {
    auto* kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return FloatArray(reinterpret_cast<float*>(kept->data()), shape, owner);
}

}  // namespace

FloatArray to_array(std::vector<Rgb>&& pixels, int width, int height) {
    static_assert(sizeof(Rgb) == 3 * sizeof(float));
    return own(std::move(pixels), {size_t(height), size_t(width), 3});
}

FloatArray to_array(std::vector<float>&& values, int width, int height) {
    return own(std::move(values), {size_t(height), size_t(width)});
}

FloatArray to_array(Vec3 v) {
    return own(std::vector<float>{v.x, v.y, v.z}, {3});
}

FloatArray to_array(Rgb c) {
    return own(std::vector<float>{c.r, c.g, c.b}, {3});
}

}  // namespace etendue::python
