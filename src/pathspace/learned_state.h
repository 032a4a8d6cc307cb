#pragma once
// The learned state of an integrator, as bytes. Values are read in the order in which they were written, and are
// bit-identical.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <utility>
#include <vector>

#include "math/padding.h"

namespace etendue {

/// Can be read by the same build only, because numbers are stored in their representation in memory. Equal states have equal
/// bytes.
class LearnedState {
public:
    template <class T>
    void put(const T& value) {
        for_each_part(value, [&](const auto& part) { put_bytes(&part, sizeof part); });
    }
    template <class T>
    void put(const std::vector<T>& values) {
        put(uint64_t(values.size()));
        if constexpr (HasNoPadding<T>)
            put_bytes(values.data(), values.size() * sizeof(T));
        else
            for (const T& value : values) put(value);
    }

    /// Throws std::runtime_error if fewer bytes are left.
    template <class T>
    void get(T& value) {
        for_each_part(value, [&](auto& part) { get_bytes(&part, sizeof part); });
    }
    template <class T>
    void get(std::vector<T>& values) {
        uint64_t size = 0;
        get(size);
        if constexpr (HasNoPadding<T>) {
            if (size > (bytes_.size() - at_) / sizeof(T)) throw_too_short();
            values.resize(size_t(size));
            get_bytes(values.data(), values.size() * sizeof(T));
        } else {
            values.clear();
            for (uint64_t i = 0; i < size; ++i) get(values.emplace_back());
        }
    }

    const std::vector<std::byte>& bytes() const { return bytes_; }
    std::vector<std::byte> take() { return std::move(bytes_); }
    /// For reading the values.
    explicit LearnedState(std::vector<std::byte> bytes) : bytes_(std::move(bytes)) {}
    LearnedState() = default;

private:
    void put_bytes(const void* data, size_t size) {
        const auto* from = static_cast<const std::byte*>(data);
        bytes_.insert(bytes_.end(), from, from + size);
    }
    void get_bytes(void* data, size_t size) {
        if (size > bytes_.size() - at_) throw_too_short();
        if (size > 0) std::memcpy(data, bytes_.data() + at_, size);
        at_ += size;
    }
    [[noreturn]] static void throw_too_short() {
        throw std::runtime_error(
            "the learned state ends too early: it belongs to another integrator");
    }

    std::vector<std::byte> bytes_;
    size_t at_ = 0;  ///< Of the next byte to be read.
};

}  // namespace etendue
