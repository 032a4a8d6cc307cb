#pragma once
// Which requests are answered, and which files they may name.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "studio/http.h"

namespace etendue {

/// 128 random bits in hexadecimal digits.
std::string make_token();

/// Why a request is refused, or nothing. Every request must name this server as its host, so that a foreign name that
/// resolves to this address (DNS rebinding) reaches nothing. Below /v1, it must hold the token and come from the own page.
std::optional<Reply> refuse(const Request& request, std::string_view token);

/// Letters, digits, '.', '_' and '-', without a leading dot; at most 128.
bool is_file_name(std::string_view name);
/// Contents of a regular file in the first of the folders that has it; links are not followed. Throws
/// std::runtime_error where there is none, or where it is larger than kMostBodyBytes.
std::string read_file_in(const std::vector<std::string>& folders, const std::string& name);
/// The first of the folders that has this regular file, with the name; throws as above.
std::string find_file_in(const std::vector<std::string>& folders, const std::string& name);

}  // namespace etendue
