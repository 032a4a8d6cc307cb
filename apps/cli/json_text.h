#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace etendue {

/// The text of a JSON value. Names of files may hold any bytes; those that are not UTF-8 are replaced.
template <class Json>
std::string json_text(const Json& json) {
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace etendue
