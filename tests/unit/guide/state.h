#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

#include "math/padding.h"

namespace etendue::test {

/// Writes and reads as LearnedState does, which belongs to a higher layer.
struct State {
    std::vector<std::byte> bytes;
    size_t at = 0;

    template <class T>
    void put(const T& value) {
        for_each_part(value, [&](const auto& part) {
            const auto* from = reinterpret_cast<const std::byte*>(&part);
            bytes.insert(bytes.end(), from, from + sizeof part);
        });
    }
    template <class T>
    void put(const std::vector<T>& values) {
        put(values.size());
        for (const T& v : values) put(v);
    }
    template <class T>
    void get(T& value) {
        for_each_part(value, [&](auto& part) {
            std::memcpy(&part, &bytes[at], sizeof part);
            at += sizeof part;
        });
    }
    template <class T>
    void get(std::vector<T>& values) {
        size_t size = 0;
        get(size);
        values.resize(size);
        for (T& v : values) get(v);
    }
};

}  // namespace etendue::test
