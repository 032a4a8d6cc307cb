#include "studio/http.h"

#include <new>

#include <nlohmann/json.hpp>

#include "system/failure.h"

namespace etendue {
namespace {

int hex_digit(char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
}

/// Decodes %XX; empty where an escape is not valid.
std::optional<std::string> decoded(std::string_view text) {
    std::string out;
    for (size_t i = 0; i < text.size(); ++i) {
        if (text[i] != '%') {
            out += text[i];
            continue;
        }
        const int high = i + 2 < text.size() ? hex_digit(text[i + 1]) : -1,
                  low = i + 2 < text.size() ? hex_digit(text[i + 2]) : -1;
        if (high < 0 || low < 0) return {};
        out += char(16 * high + low);
        i += 2;
    }
    return out;
}

}  // namespace

std::optional<std::string> Request::query(std::string_view name) const {
    const size_t mark = target.find('?');
    if (mark == std::string::npos) return {};
    std::optional<std::string> value;
    for (std::string_view rest = std::string_view(target).substr(mark + 1); !rest.empty();) {
        const size_t end = rest.find('&');
        const std::string_view pair = rest.substr(0, end);
        rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
        const size_t equals = pair.find('=');
        if (pair.substr(0, equals) != name || equals == std::string_view::npos) continue;
        if (value) return {};
        value = decoded(pair.substr(equals + 1));
        if (!value) return {};
    }
    return value;
}

Reply Reply::error(int status, std::string_view message) {
    // Messages may quote bytes of a request that are not UTF-8.
    const nlohmann::json body{{"error", message}};
    Reply reply = json(body.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
    reply.status = status;
    return reply;
}

Reply Reply::current_exception() {
    try {
        throw;
    } catch (const ApiError& e) {
        return error(e.status, e.what());
    } catch (const std::bad_alloc&) {
        return error(503, "not enough memory");
    } catch (...) {
        return error(422, caught());
    }
}

}  // namespace etendue
