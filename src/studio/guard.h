#pragma once
// Checks of requests, and of the files that they name.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "studio/http.h"

namespace etendue {

/// 128 random bits in hexadecimal digits.
std::string make_token();

/// The reply to a request that is rejected; empty if it is accepted. Every request must name this server as its host, which
/// prevents DNS rebinding. Requests below /v1 must contain the token and come from the server's own page.
std::optional<Reply> refuse(const Request& request, std::string_view token);

/// Whether a name consists of at most 128 letters, digits, '.', '_' and '-', without a leading dot.
bool is_file_name(std::string_view name);
/// Contents of a regular file in the first of the folders that has it; links are not followed. Throws
/// std::runtime_error if there is none, or if it is larger than kMostBodyBytes.
std::string read_file_in(const std::vector<std::string>& folders, const std::string& name);
/// The first of the folders that has this regular file, with the name; throws as above.
std::string find_file_in(const std::vector<std::string>& folders, const std::string& name);

}  // namespace etendue
