#pragma once

#include <stdexcept>
#include <string>

namespace etendue::test {

/// What a call complains about, or "".
template <class Call>
std::string error_of(const Call& call) {
    try {
        call();
    } catch (const std::runtime_error& e) {
        return e.what();
    }
    return "";
}

}  // namespace etendue::test
