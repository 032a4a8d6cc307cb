#pragma once
// JSON from files and requests. All readers of JSON use this function: its documents are no deeper than their recursive
// copies and prints can bear, and its errors name the line.

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace etendue {

/// Values nested more deeply are refused.
constexpr int kDeepestJson = 64;

/// Throws SceneError, with `file` and line, where the text is not JSON in UTF-8 or is nested too deeply.
nlohmann::json parse_json(std::string_view text, const std::string& file);

/// The text as it is read again from JSON that was written with error_handler_t::replace: with marks in place of what is not
/// UTF-8, which names of files may have.
std::string as_utf8(const std::string& text);

/// The value as JSON, or its beginning where it is long, for messages.
std::string excerpt(const nlohmann::json& value);

}  // namespace etendue
