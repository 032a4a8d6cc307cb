#include "studio/request_values.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "description/json_text.h"
#include "description/source_location.h"
#include "studio/reply_json.h"

namespace etendue {

using nlohmann::json;

namespace {

double positive(const json& body, const char* name) {
    const json& value = body[name];
    if (!value.is_number() || !(value.get<double>() > 0))
        throw ApiError(422, fmt::format("\"{}\" must be a number above 0", name));
    return value.get<double>();
}

}  // namespace

Vec3 to_vec(const json& value, const char* name) {
    if (!value.is_array() || value.size() != 3)
        throw ApiError(422, fmt::format("\"{}\" must be [x, y, z]", name));
    Vec3 v;
    for (int i = 0; i < 3; ++i) {
        if (!value[size_t(i)].is_number())
            throw ApiError(422, fmt::format("\"{}\" must be three numbers", name));
        v[i] = value[size_t(i)].get<float>();
        if (!(std::abs(v[i]) <= GivenPath::kFarthest))
            throw ApiError(422,
                           fmt::format("\"{}\" must not exceed {:g}", name, GivenPath::kFarthest));
    }
    return v;
}

json parse_body(const std::string& text) {
    try {
        return parse_json(text, "body");
    } catch (const SceneError& e) {
        throw ApiError(400, e.what());
    }
}

json parse_object(const std::string& text) {
    json body = parse_body(text);
    if (!body.is_object()) throw ApiError(400, "the body must be a JSON object");
    return body;
}

int64_t integer(const json& body, const char* name, int64_t low, int64_t high,
                std::optional<int64_t> fallback) {
    const auto at = body.find(name);
    if (at == body.end() && fallback) return *fallback;
    // Unsigned numbers above the range of int64_t are above `high` too.
    const bool is_integer =
        at != body.end() && at->is_number_integer() &&
        !(at->is_number_unsigned() && at->get<uint64_t>() > uint64_t(INT64_MAX));
    if (!is_integer || at->get<int64_t>() < low || at->get<int64_t>() > high)
        throw ApiError(422, fmt::format("\"{}\" must be an integer in [{}, {}]", name, low, high));
    return at->get<int64_t>();
}

bool boolean(const json& body, const char* name) {
    const auto at = body.find(name);
    if (at == body.end()) return false;
    if (!at->is_boolean()) throw ApiError(422, fmt::format("\"{}\" must be true or false", name));
    return at->get<bool>();
}

std::string text_of(const json& body, const char* name, const std::string& fallback) {
    const auto at = body.find(name);
    if (at == body.end()) return fallback;
    if (!at->is_string()) throw ApiError(422, fmt::format("\"{}\" must be a text", name));
    return at->get<std::string>();
}

int integer_of(std::string_view text, const char* name) {
    int value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size())
        throw ApiError(400, fmt::format("\"{}\" must be an integer", name));
    return value;
}

int query_integer(const Request& request, const char* name, int fallback) {
    const std::optional<std::string> text = request.query(name);
    return text ? integer_of(*text, name) : fallback;
}

ImageRect rect_of(std::string_view text) {
    std::array<int, 4> v{};
    for (size_t i = 0; i < v.size(); ++i) {
        const size_t end = i + 1 < v.size() ? text.find(',') : text.size();
        if (end == std::string_view::npos) throw ApiError(400, "\"rect\" must be x,y,width,height");
        v[i] = integer_of(text.substr(0, end), "rect");
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    return {v[0], v[1], v[2], v[3]};
}

RenderLimits limits_of(const json& body) {
    RenderLimits limits;
    if (body.contains("spp")) limits.spp = uint64_t(integer(body, "spp", 1, int64_t(1) << 32));
    if (body.contains("seconds")) limits.seconds = positive(body, "seconds");
    if (body.contains("error")) limits.error = positive(body, "error");
    return limits;
}

std::vector<GivenPath> paths_of(const json& list, const std::string& file) {
    constexpr size_t kMostPaths = 1000, kMostPoints = 32;
    if (!list.is_array()) throw ApiError(422, "\"paths\" must be a list");
    if (list.size() > kMostPaths)
        throw ApiError(422, fmt::format("at most {} paths are allowed", kMostPaths));
    std::vector<GivenPath> paths;
    try {
        paths = parse_user_paths(dump(list), file);
    } catch (const std::exception& e) {
        throw ApiError(422, e.what());
    }
    for (const GivenPath& path : paths)
        if (path.points.size() > kMostPoints)
            throw ApiError(422, fmt::format("at most {} points a path are allowed", kMostPoints));
    return paths;
}

}  // namespace etendue
