#pragma once

#include <stdexcept>
#include <string>

namespace etendue::test {

/// What a call complains about, or "".
template <class Error = std::runtime_error, class Call>
std::string error_of(const Call& call) {
    try {
        call();
    } catch (const Error& e) {
        return e.what();
    }
    return "";
}

}  // namespace etendue::test
