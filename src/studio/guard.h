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
/// prevents DNS rebinding: by the address at which it arrives, as localhost, or by one of `hosts`, in lower case. Requests
/// below /v1 must contain the token and come from the server's own page.
std::optional<Reply> refuse(const Request& request, std::string_view token,
                            const std::vector<std::string>& hosts = {});
/// Whether a host can have this name: letters, digits, '-' and '.'.
bool is_host_name(std::string_view name);
std::string lower_case(std::string_view text);

/// Whether a name consists of at most 128 letters, digits, '.', '_' and '-', without a leading dot.
bool is_file_name(std::string_view name);
/// Contents of a regular file in the first of the folders that has it; links are not followed. Empty if there is nothing
/// of that name. Throws std::runtime_error for a file that cannot be read, is larger than kMostBodyBytes, or is none.
std::optional<std::string> read_file_in(const std::vector<std::string>& folders,
                                        const std::string& name);
/// Whether a file of this name may be written: 409 if there is something else than a regular file, or, unless it is to be
/// replaced, a regular file.
void check_writable(const std::string& folder, const std::string& name, bool replaces);
/// The first of the folders that has this regular file, with the name; throws also where none has.
std::string find_file_in(const std::vector<std::string>& folders, const std::string& name);

}  // namespace etendue
