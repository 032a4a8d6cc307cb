#pragma once

#include <cstddef>
#include <cstring>
#include <vector>

namespace etendue::test {

/// Writes and reads as LearnedState does, which belongs to a higher layer.
struct State {
    std::vector<std::byte> bytes;
    size_t at = 0;

    template <class T>
    void put(const T& value) {
        const auto* from = reinterpret_cast<const std::byte*>(&value);
        bytes.insert(bytes.end(), from, from + sizeof(T));
    }
    template <class T>
    void put(const std::vector<T>& values) {
        put(values.size());
        for (const T& v : values) put(v);
    }
    template <class T>
    void get(T& value) {
        std::memcpy(&value, &bytes[at], sizeof(T));
        at += sizeof(T);
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
