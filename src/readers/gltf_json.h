#pragma once
// A value of a JSON document together with its place in it, for messages such as
// "scene.gltf: /meshes/2/primitives/0/indices: must be an integer".

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <limits>

#include <nlohmann/json.hpp>

#include "description/source_location.h"

namespace etendue {

class JsonValue {
public:
    /// `value` may be nullptr: an absent value. `file` and `value` must outlive the object.
    JsonValue(const nlohmann::json* value, const FileName* file, std::string path)
        : value_(value), file_(file), path_(std::move(path)) {}

    explicit operator bool() const { return value_ != nullptr; }
    const std::string& path() const { return path_; }
    SourceLocation where() const { return {*file_, 0}; }
    [[noreturn]] void fail(const std::string& message) const;

    /// The member of an object, absent where there is none. Fails where this value is no object; of an absent value all
    /// members are absent.
    JsonValue operator[](std::string_view member) const;
    /// The elements of an array; none of an absent value.
    std::vector<JsonValue> elements() const;
    /// Names of the members of an object.
    std::vector<std::string> members() const;

    double number(double fallback, double lo = -kUnlimited, double hi = kUnlimited) const;
    /// Exactly `count` numbers; `fallback` where the value is absent.
    std::vector<double> numbers(size_t count, std::vector<double> fallback) const;
    bool flag(bool fallback) const;
    std::string text(std::string_view fallback) const;
    int64_t integer(int64_t fallback, int64_t lo, int64_t hi) const;
    /// An index below `count`; empty where the value is absent.
    std::optional<size_t> index(size_t count) const;

private:
    static constexpr double kUnlimited = 1e30;

    /// Fails with what the value is.
    [[noreturn]] void fail_type(const char* expected) const;

    const nlohmann::json* value_;
    const FileName* file_;
    std::string path_;
};

}  // namespace etendue
