#pragma once

#include <iterator>
#include <sstream>
#include <string>
#include <vector>

namespace etendue::test {

/// The words of a text between white space.
inline std::vector<std::string> words(const char* text) {
    std::istringstream in(text);
    return {std::istream_iterator<std::string>(in), {}};
}

}  // namespace etendue::test
