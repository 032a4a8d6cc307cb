#include "readers/gltf_json.h"

#include <fmt/format.h>

namespace etendue {

void JsonValue::fail(const std::string& message) const {
    throw SceneError(where(), fmt::format("{}: {}", path_.empty() ? "/" : path_, message));
}

void JsonValue::fail_type(const char* expected) const {
    constexpr size_t kMost = 40;
    const std::string found =
        value_->is_structured()
            ? std::string(value_->is_array() ? "an array" : "an object")
            : value_->dump(-1, ' ', true, nlohmann::json::error_handler_t::replace);
    fail(fmt::format("{}, but is {}{}{}", expected, value_->is_string() ? "the string " : "",
                     found.substr(0, kMost), found.size() > kMost ? "..." : ""));
}

JsonValue JsonValue::operator[](std::string_view member) const {
    std::string path = fmt::format("{}/{}", path_, member);
    if (!value_) return {nullptr, file_, std::move(path)};
    if (!value_->is_object()) fail_type("must be an object");
    const auto it = value_->find(std::string(member));
    return {it == value_->end() ? nullptr : &*it, file_, std::move(path)};
}

std::vector<JsonValue> JsonValue::elements() const {
    std::vector<JsonValue> found;
    if (!value_) return found;
    if (!value_->is_array()) fail_type("must be an array");
    for (size_t i = 0; i < value_->size(); ++i)
        found.push_back({&(*value_)[i], file_, fmt::format("{}/{}", path_, i)});
    return found;
}

std::vector<std::string> JsonValue::members() const {
    std::vector<std::string> names;
    if (!value_) return names;
    if (!value_->is_object()) fail_type("must be an object");
    for (const auto& [name, value] : value_->items()) names.push_back(name);
    return names;
}

double JsonValue::number(double fallback, double lo, double hi) const {
    if (!value_) return fallback;
    if (!value_->is_number()) fail_type("must be a number");
    const double v = value_->get<double>();
    if (!(v >= lo && v <= hi))
        fail(lo == -kUnlimited || hi == kUnlimited
                 ? fmt::format("is {}, which is out of range", v)
                 : fmt::format("is {}, but must lie in [{}, {}]", v, lo, hi));
    return v;
}

std::vector<double> JsonValue::numbers(size_t count, std::vector<double> fallback) const {
    if (!value_) return fallback;
    const std::vector<JsonValue> parts = elements();
    if (parts.size() != count)
        fail(fmt::format("must have {} numbers, but has {}", count, parts.size()));
    std::vector<double> values;
    for (const JsonValue& part : parts) values.push_back(part.number(0));
    return values;
}

bool JsonValue::flag(bool fallback) const {
    if (!value_) return fallback;
    if (!value_->is_boolean()) fail_type("must be true or false");
    return value_->get<bool>();
}

std::string JsonValue::text(std::string_view fallback) const {
    if (!value_) return std::string(fallback);
    if (!value_->is_string()) fail_type("must be a string");
    return value_->get<std::string>();
}

int64_t JsonValue::integer(int64_t fallback, int64_t lo, int64_t hi) const {
    if (!value_) return fallback;
    if (!value_->is_number_integer()) fail_type("must be an integer");
    const bool fits = !value_->is_number_unsigned() ||
                      value_->get<uint64_t>() <= uint64_t(std::numeric_limits<int64_t>::max());
    const int64_t v = fits ? value_->get<int64_t>() : std::numeric_limits<int64_t>::max();
    if (v < lo || v > hi) fail(fmt::format("is {}, but must lie in [{}, {}]", v, lo, hi));
    return v;
}

std::optional<size_t> JsonValue::index(size_t count) const {
    if (!value_) return {};
    if (count == 0 && value_->is_number_integer()) fail("refers to an entry of an empty list");
    return size_t(integer(0, 0, int64_t(count) - 1));
}

}  // namespace etendue
