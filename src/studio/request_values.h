#pragma once
// Values of requests, from JSON and from queries. What is missing, of another type or out of range is an ApiError.

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "math/vec.h"
#include "mcmc/user_paths.h"
#include "render/renderer.h"
#include "studio/http.h"
#include "studio/image_reply.h"

namespace etendue {

nlohmann::json parse_body(const std::string& text);
nlohmann::json parse_object(const std::string& text);
/// A vector whose components are at most GivenPath::kFarthest; `name` is for messages.
Vec3 to_vec(const nlohmann::json& value, const char* name);
/// An integer of the body in [low, high]; throws where it is missing, unless there is a fallback.
int64_t integer(const nlohmann::json& body, const char* name, int64_t low, int64_t high,
                std::optional<int64_t> fallback = {});
bool boolean(const nlohmann::json& body, const char* name);  ///< False where it is missing.
/// A text of the body; `fallback` where it is missing.
std::string text_of(const nlohmann::json& body, const char* name, const std::string& fallback = {});
RenderLimits limits_of(const nlohmann::json& body);
/// The paths of a list, within the limits of the protocol; `file` is for messages.
std::vector<GivenPath> paths_of(const nlohmann::json& list, const std::string& file);
int query_integer(const Request& request, const char* name, int fallback);
/// A whole text as an integer; `name` is for messages.
int integer_of(std::string_view text, const char* name);
/// A rectangle as x,y,width,height.
ImageRect rect_of(std::string_view text);

}  // namespace etendue
